// The Settings tab's place: what fills it is loaded when it is first looked at, so that the page begins without it.

import { field, setText } from '../core/dom.js';

export class SettingsTab {
  /** @type {Promise<void> | null} */
  #loading = null;

  /**
   * @param {HTMLElement} panel
   * @param {import('../core/store.js').Store} store
   * @param {(sentence: string, title?: string) => void} say
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
    if (this.isShown()) this.#loading ??= this.#load();
  }

  async #load() {
    try {
      const { mount } = await import('../settings/settings.js');
      mount(this.panel, this.store, this.say, this.isShown);
    } catch {
      setText(field(this.panel, 'settings-state'), 'The settings could not be fetched: the server does not answer. Open this tab again.');
      this.#loading = null;
    }
  }
}
