// The five tabs: swiped natively, pressed, reached by arrow keys or by a deep link, and remembered.

import { field, listen, setAttribute } from '../core/dom.js';

export const TABS = /** @type {const} */ (['home', 'map', 'scan', 'files', 'settings']);
const REMEMBERED = 'catgraph.tab';
/** From this width on tabs may stand side by side (wide.css): below it no size need be asked for, which has all laid out. */
const SIDE_BY_SIDE = '(min-width: 760px)';
/** So long after the last finger and the last movement the tabs are at rest [ms]. */
const FOLD_AFTER_MS = 700;

/**
 * Which tab a key leads to, or null where it is none of ours.
 * @param {string} key
 * @param {number} index of the tab in front
 */
export function tabByKey(key, index) {
  const last = TABS.length - 1;
  if (key === 'ArrowRight') return Math.min(last, index + 1);
  if (key === 'ArrowLeft') return Math.max(0, index - 1);
  if (key === 'Home') return 0;
  if (key === 'End') return last;
  return null;
}

/**
 * The tab a link names: "#map" is 1; −1 where it names none.
 * @param {string} hash
 */
export function tabByHash(hash) {
  return TABS.findIndex((tab) => `#${tab}` === hash.toLowerCase());
}

/** The tabs; `onFront` hears which is in front, from the start on. */
export class Tabs {
  #front = -1;
  #isPlaced = false;

  /**
   * @param {HTMLElement} root
   * @param {() => void} onFront
   */
  constructor(root, onFront) {
    this.pager = field(root, 'pager');
    this.buttons = TABS.map((tab) => /** @type {HTMLElement} */ (root.querySelector(`[data-tab="${tab}"]`)));
    this.panels = TABS.map((tab) => /** @type {HTMLElement} */ (root.querySelector(`[data-panel="${tab}"]`)));
    this.onFront = onFront;
    const wanted = tabByHash(location.hash);
    this.index = wanted >= 0 ? wanted : Math.max(0, TABS.indexOf(/** @type {any} */ (remembered())));
    this.stops = [
      ...this.buttons.map((button, i) => listen(button, 'click', () => this.go(i))),
      ...this.buttons.map((button) => listen(button, 'keydown', (event) => this.#key(event))),
      listen(this.pager, 'scroll', () => this.#scrolled(), { passive: true }),
      listen(this.pager, 'pointerdown', () => this.#unfold(), { passive: true }),
      listen(this.pager, 'wheel', () => this.#unfold(), { passive: true }),
      listen(window, 'hashchange', () => this.#linked()),
      listen(window, 'resize', () => root.hidden || this.place()), // a page that begins is told of its size: nothing is shown yet
    ];
    this.#bring(this.index);
    this.#fold();
  }

  /** Unmount. */
  stop() {
    clearTimeout(this.#folding);
    for (const stop of this.stops) stop();
  }

  /** The pager has a size only once it is shown: put the tab in front where it belongs, without a movement. */
  place() {
    const isFirst = this.index === 0 && !this.#isPlaced; // it is there already: no need to have it all laid out for that
    if (!isFirst && !this.pager.clientWidth) return;
    if (!isFirst) this.pager.scrollTo({ left: this.#leftOf(this.index), behavior: 'instant' });
    this.#isPlaced = true;
    this.#still();
    this.#fold();
    this.onFront();
  }

  /** What is out of sight is out of reach of keys and readers, and its tab is not marked. */
  #still() {
    this.panels.forEach((panel, i) => {
      const isShown = this.shows(TABS[i] ?? 'home');
      setAttribute(panel, 'inert', !isShown);
      setAttribute(this.buttons[i] ?? panel, 'data-shown', isShown); // on a wide screen several are
    });
  }

  /** What is out of sight is neither laid out nor painted: half of what the page costs. @type {ReturnType<typeof setTimeout> | undefined} */
  #folding;

  /** While a finger or a wheel may move them, all are there; at rest those out of sight are folded again. */
  #unfold() {
    for (const panel of this.panels) setAttribute(panel, 'data-folded', null);
    clearTimeout(this.#folding);
    this.#folding = setTimeout(() => this.#fold(), FOLD_AFTER_MS);
  }

  #fold() {
    clearTimeout(this.#folding);
    for (const panel of this.panels) setAttribute(panel, 'data-folded', panel.inert);
  }

  /**
   * Show a tab.
   * @param {number} index
   */
  go(index) {
    this.#unfold();
    this.#bring(index);
    const isStill = matchMedia('(prefers-reduced-motion: reduce)').matches;
    this.pager.scrollTo({ left: this.#leftOf(index), behavior: isStill ? 'instant' : 'smooth' });
    this.#aim = index;
  }

  /** Is any of this tab to be seen? On a wide screen several stand side by side. @param {string} tab */
  shows(tab) {
    if (this.front === tab) return true;
    if (!matchMedia(SIDE_BY_SIDE).matches) return false;
    const panel = this.panels[TABS.indexOf(/** @type {any} */ (tab))];
    if (!panel || !this.pager.clientWidth || panel.clientWidth > this.pager.clientWidth - 40) return false;
    const left = this.#leftOf(this.panels.indexOf(panel)) - this.pager.scrollLeft;
    return left > -panel.clientWidth + 40 && left < this.pager.clientWidth - 40;
  }

  get front() {
    return TABS[this.index] ?? 'home';
  }

  /** Where a press is scrolling to; what it passes on its way is not in front. @type {number | null} */
  #aim = null;

  /** @param {number} index */
  #leftOf(index) {
    return (this.panels[index]?.offsetLeft ?? 0) - (this.panels[0]?.offsetLeft ?? 0);
  }

  #scrolled() {
    if (!this.#isPlaced || !this.pager.clientWidth) return;
    const { scrollLeft } = this.pager;
    if (Math.abs(this.#leftOf(this.index) - scrollLeft) > 1) this.#unfold();
    const nearest = this.panels.reduce((best, _, i) =>
      Math.abs(this.#leftOf(i) - scrollLeft) < Math.abs(this.#leftOf(best) - scrollLeft) ? i : best, 0);
    if (this.#aim !== null && nearest !== this.#aim) return;
    this.#aim = null;
    if (nearest === this.index) {
      this.#still();
      this.onFront();
    } else this.#bring(nearest);
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const index = tabByKey(event.key, this.index);
    if (index === null) return;
    event.preventDefault();
    this.go(index);
    this.buttons[index]?.focus();
  }

  #linked() {
    const index = tabByHash(location.hash);
    if (index >= 0 && index !== this.index) this.go(index);
  }

  /** Into the address, and to be remembered. @param {string} tab */
  #note(tab) {
    history.replaceState(history.state, '', `#${tab}`);
    remember(tab);
  }

  /** @param {number} index */
  #bring(index) {
    this.index = index;
    if (index === this.#front) return;
    this.#front = index;
    this.#still();
    const tab = TABS[index] ?? 'home';
    this.buttons.forEach((button, i) => {
      setAttribute(button, 'aria-selected', String(i === index));
      setAttribute(button, 'tabindex', i === index ? 0 : -1);
    });
    if (this.#isPlaced) this.#note(tab);
    else setTimeout(() => this.index === index && this.#note(tab)); // a page that begins has more urgent things to do
    this.onFront();
  }
}

function remembered() {
  try {
    return localStorage.getItem(REMEMBERED);
  } catch {
    return null;
  }
}

/** @param {string} tab */
function remember(tab) {
  try {
    localStorage.setItem(REMEMBERED, tab);
  } catch {
    // no storage: forgotten
  }
}
