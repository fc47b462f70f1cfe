// A list shown a page at a time: no row is sliced. The rows stay in the document, those of other pages hidden.

import { html, icon, listen, setAttribute, setSentence, show } from '../core/dom.js';
import { pagesOf } from './alarm-pages.js';

export class PagedList {
  #pages = [0];
  #page = 0;
  /** So many rows stand above the list, and are counted. */
  above = 0;

  /** @param {HTMLElement} list its children are the rows @param {() => void} onTurn another page is shown */
  constructor(list, onTurn) {
    this.list = list;
    this.onTurn = onTurn;
    const key = (/** @type {string} */ name, /** @type {string} */ label) => html('button', { type: 'button', class: 'key', 'aria-label': label, 'data-f': name }, icon(name === 'before' ? 'back' : 'next'));
    this.before = key('before', 'Previous page');
    this.after = key('after', 'Next page');
    this.position = html('span', { role: 'status', 'data-f': 'pages' });
    this.element = html('div', { class: 'turn' }, this.before, this.position, this.after);
    const observer = new ResizeObserver(() => this.lay());
    observer.observe(list);
    this.stops = [
      listen(this.before, 'click', () => this.#turn(-1)), listen(this.after, 'click', () => this.#turn(1)), () => observer.disconnect(),
    ];
  }

  /** First and last row of this page, the last excluded. @returns {[number, number]} */
  get shown() {
    return [this.#pages[this.#page] ?? 0, this.#pages[this.#page + 1] ?? this.list.children.length];
  }

  /** Measure the rows and show those of this page. */
  lay() {
    const rows = /** @type {HTMLElement[]} */ ([...this.list.children]);
    for (const row of rows) show(row, true);
    this.#pages = pagesOf(rows.map((row) => row.offsetHeight), this.list.clientHeight);
    this.#page = Math.min(this.#page, this.#pages.length - 1);
    this.#show();
  }

  /** Longer texts may have made rows higher: measured again where they no longer fit. */
  look() {
    if (this.list.scrollHeight > this.list.clientHeight + 1) this.lay();
  }

  /** @param {number} by */
  #turn(by) {
    const page = Math.max(0, Math.min(this.#pages.length - 1, this.#page + by));
    if (page === this.#page) return;
    this.#page = page;
    this.#show();
  }

  #show() {
    const [from, to] = this.shown;
    const { length } = this.list.children;
    [...this.list.children].forEach((row, i) => show(row, i >= from && i < to));
    show(this.element, length > 0);
    setAttribute(this.before, 'aria-disabled', from === 0);
    setAttribute(this.after, 'aria-disabled', to >= length);
    const { above } = this;
    setSentence(this.position, length ? `${to - from > 1 ? `${above + from + 1}–${above + to}` : above + to} of ${above + length}` : '');
    this.onTurn();
  }

  stop() {
    for (const stop of this.stops) stop();
  }
}
