// The Files tab's place: what fills it is fetched when the tab first comes to the front, so that the page begins without it.

import { field, setText } from '../core/dom.js';

export class FilesTab {
  /** @type {Promise<void> | null} */
  #loading = null;
  /** @type {(() => void) | null} */
  #look = null;

  /**
   * @param {HTMLElement} panel
   * @param {import('../core/store.js').Store} store
   * @param {(sentence: string, title?: string, way?: import('./notice.js').Way) => void} say
   * @param {() => boolean} isShown
   */
  constructor(panel, store, say, isShown) {
    this.panel = panel;
    this.store = store;
    this.say = say;
    this.isShown = isShown;
  }

  /** Called whenever another tab comes in front. */
  look() {
    if (!this.isShown()) return;
    this.#loading ??= this.#load();
    this.#look?.();
  }

  async #load() {
    try {
      const { mount } = await import('../files/files.js');
      this.#look = mount(this.panel, this.store, this.say, this.isShown).look;
    } catch {
      setText(field(this.panel, 'files-state'), 'The recordings could not be fetched: the server does not answer. Open this tab again.');
      this.#loading = null;
    }
  }
}
