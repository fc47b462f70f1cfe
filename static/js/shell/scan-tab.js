// The Scan tab's place: what draws it is fetched when the tab first comes to the front, so that the page begins without it.

import { field, setText, show } from '../core/dom.js';

export class ScanTab {
  /** @type {ReturnType<typeof import('../scan/scan.js').mount> | null} */
  #scan = null;
  #isFront = false;
  #isLoading = false;

  /**
   * @param {HTMLElement} panel
   * @param {import('../core/store.js').Store} store
   */
  constructor(panel, store) {
    this.panel = panel;
    this.store = store;
  }

  /** @param {boolean} isFront is it seen? Only then scans are sent and drawn */
  setFront(isFront) {
    this.#isFront = isFront;
    if (this.#scan) this.#scan.setFront(isFront);
    else if (isFront && !this.#isLoading) this.#load();
  }

  async #load() {
    this.#isLoading = true;
    try {
      const { mount } = await import('../scan/scan.js');
      this.#say('');
      this.#scan = mount(this.panel, this.store);
      this.#scan.setFront(this.#isFront);
    } catch (error) {
      console.warn('The scan could not be fetched:', error);
      this.#say('The scan could not be fetched: the server does not answer. Open this tab again.');
    } finally {
      this.#isLoading = false;
    }
  }

  /** @param {string} sentence */
  #say(sentence) {
    setText(field(this.panel, 'none-words'), sentence);
    show(field(this.panel, 'none'), sentence !== '');
  }
}
