// A tab whose content is fetched when the tab first comes to the front, so that the page begins without it.

import { field, setText, show } from '../core/dom.js';

/**
 * @typedef {{look?: () => void, stop?: () => void}} Content what a module mounts; `look` is called whenever another tab or screen comes in front
 */

/**
 * @template Module
 * @typedef {object} Tab
 * @property {string} what is named where it cannot be fetched
 * @property {string} state the field of the panel for this text; `none-words` stands in the field `none`, which is hidden otherwise
 * @property {() => boolean} isShown
 * @property {() => Promise<Module>} fetch
 * @property {(module: Module) => Content} mount
 * @property {boolean | undefined} [isNear] fetch it as soon as an edge of it is seen, for example in a swipe
 */

/** @template Module */
export class LazyTab {
  #panel;
  #tab;
  /** @type {Content | null} */
  #content = null;
  #isLoading = false;

  /**
   * @param {HTMLElement} panel
   * @param {Tab<Module>} tab
   */
  constructor(panel, tab) {
    this.#panel = panel;
    this.#tab = tab;
    if (!tab.isNear) return;
    const near = new IntersectionObserver((seen) => {
      if (seen.some(({ intersectionRect }) => intersectionRect.width > 0)) this.#load(); // beside it is not in sight
    }, { threshold: [0, 0.01] });
    near.observe(panel);
  }

  /** Called whenever another tab or screen comes in front. */
  look() {
    if (this.#content) this.#content.look?.();
    else if (this.#tab.isShown()) this.#load();
  }

  async #load() {
    if (this.#content || this.#isLoading) return;
    this.#isLoading = true;
    const { what, fetch, mount } = this.#tab;
    try {
      const module = await fetch();
      this.#say('');
      this.#content = mount(module);
    } catch (error) {
      console.warn(`${what} could not be fetched:`, error);
      this.#say(`${what} could not be loaded: the server does not answer. Open this tab again.`);
    } finally {
      this.#isLoading = false;
    }
  }

  /** @param {string} sentence */
  #say(sentence) {
    const { state } = this.#tab;
    setText(field(this.#panel, state), sentence);
    if (state === 'none-words') show(field(this.#panel, 'none'), sentence !== '');
  }
}
