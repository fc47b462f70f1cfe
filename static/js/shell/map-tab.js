// The Map tab's place: what fills it is fetched when the tab first comes near, so that the page begins without it.

import { field, setText, show } from '../core/dom.js';

export class MapTab {
  /** @type {Promise<void> | null} */
  #loading = null;

  /**
   * @param {HTMLElement} panel
   * @param {import('../core/store.js').Store} store
   * @param {() => boolean} isShown
   * @param {(sentence: string, title?: string) => void} say
   */
  constructor(panel, store, isShown, say) {
    this.say = say;
    this.panel = panel;
    this.store = store;
    this.isShown = isShown;
    // A swipe brings the tab's edge into sight before the tab is in front.
    const near = new IntersectionObserver((seen) => {
      if (seen.some(({ intersectionRect }) => intersectionRect.width > 0)) this.#fetch(); // beside it is not in sight
    }, { threshold: [0, 0.01] });
    near.observe(panel);
  }

  /** Called whenever another tab comes in front. */
  look() {
    if (this.isShown()) this.#fetch();
  }

  #fetch() {
    this.#loading ??= this.#load();
  }

  async #load() {
    try {
      const { mount } = await import('../map/map.js');
      mount(this.panel, this.store, this.isShown, this.say);
    } catch (error) {
      console.warn('The map could not be fetched:', error);
      setText(field(this.panel, 'none-words'), 'The map could not be fetched: the server does not answer. Open this tab again.');
      show(field(this.panel, 'none'), true);
      this.#loading = null;
    }
  }
}
