// A group of the Settings tab that is folded away, and whose content is fetched when it is opened.

import { html, icon, listen, setText, show } from '../core/dom.js';
import { found } from './settings-layout.js';

/** @typedef {(place: HTMLElement, group: HTMLDetailsElement, head: (text: string) => void) => Promise<unknown>} Fill `head` shows the state in the group's summary */

export class FetchedGroup {
  #isOpenedBySearch = false;
  /** What came for an older one is not shown. */
  #turn = 0;
  #isLoaded = false;

  /**
   * @param {string} part its name for tests and links
   * @param {string} title
   * @param {string} names what a search finds it by
   * @param {Fill} fill
   * @param {{isThere?: boolean, isEachTime?: boolean}} [how] isEachTime: somebody else may have changed it since it was opened before
   */
  constructor(part, title, names, fill, { isThere = true, isEachTime = false } = {}) {
    this.names = [names];
    this.fill = fill;
    this.isThere = isThere;
    this.isEachTime = isEachTime;
    this.state = html('span', { class: 'count' });
    this.place = html('div');
    this.group = /** @type {HTMLDetailsElement} */ (html('details', { class: 'group', 'data-part': part, hidden: !isThere },
      html('summary', {}, html('span', { class: 'h' }, title), this.state, icon('next')), this.place));
    /** What stands in the tab. @type {HTMLElement} */
    this.element = this.group;
    this.stop = listen(this.group, 'toggle', () => { if (this.group.open) this.#load(); });
  }

  /** Shows it where a search matches; returns how many there are. @param {string} query */
  filter(query) {
    const { group } = this;
    const isHit = this.isThere && found(query, this.names);
    show(group, isHit);
    if (query && isHit && !group.open) {
      group.open = true;
      this.#isOpenedBySearch = true;
    } else if (!query && this.#isOpenedBySearch) {
      group.open = false;
      this.#isOpenedBySearch = false;
    }
    return Number(isHit);
  }

  /** What it shows is of another car. */
  forget() {
    this.#turn += 1;
    this.#isLoaded = false;
    this.group.open = false;
    setText(this.state, '');
    this.place.replaceChildren();
  }

  #load() {
    if (this.#isLoaded && !this.isEachTime) return;
    this.#isLoaded = true;
    const turn = this.#turn += 1;
    const isMine = () => turn === this.#turn;
    const place = html('div', {}, html('p', { class: 'state', role: 'status' }, 'Loading from the server…'));
    this.place.replaceChildren(place);
    this.fill(place, this.group, (text) => { if (isMine()) setText(this.state, text); }).catch(() => {
      if (isMine()) this.#isLoaded = false;
      place.replaceChildren(html('p', { class: 'state', role: 'status' }, 'It could not be loaded: the server does not answer. Close this group and open it again.'));
    });
  }
}
