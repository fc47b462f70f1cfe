// The tabs, which the server declares: swiped natively, pressed, reached by arrow keys or by a deep link, and remembered.

import { field, listen, setAttribute } from '../core/dom.js';
import { floorQuery, isFloor, isWall } from './layout.js';

const REMEMBERED = 'catgraph.tab';
/** So long after the last finger and the last movement the tabs are at rest [ms]. */
const FOLD_AFTER_MS = 700;

/**
 * Which tab a key leads to, or null where it is none of ours.
 * @param {string} key
 * @param {number} index of the tab in front
 * @param {number} last index
 */
export function tabByKey(key, index, last) {
  if (key === 'ArrowRight') return Math.min(last, index + 1);
  if (key === 'ArrowLeft') return Math.max(0, index - 1);
  if (key === 'Home') return 0;
  if (key === 'End') return last;
  return null;
}

/**
 * The tab a link names: "#map" is 1; −1 where it names none.
 * @param {string} hash
 * @param {string[]} names
 */
export function tabByHash(hash, names) {
  return names.findIndex((tab) => `#${tab}` === hash.toLowerCase());
}

/**
 * Which tabs can be seen: of panes all at once, unless a page takes their place or a drawer stands over those beside Home.
 * @param {{name: string, wide: string}[]} tabs
 * @param {number} index of the tab in front
 * @param {boolean} hasPanes
 * @param {boolean} [hasWall] the panes stay beside a drawer too
 */
export function tabsInSight(tabs, index, hasPanes, hasWall = false) {
  const front = tabs[index];
  if (!hasPanes || !front || front.wide === 'page') return front ? [front.name] : [];
  return tabs.filter((tab, i) => i === index || (tab.wide === 'pane' && (front.wide === 'pane' || hasWall || tab === tabs[0]))).map(({ name }) => name);
}

/** The tabs; `onFront` receives which is in front, from the start on. */
export class Tabs {
  #front = -1;
  #isPlaced = false;

  /**
   * @param {HTMLElement} root
   * @param {() => void} onFront
   */
  constructor(root, onFront) {
    this.root = root;
    this.pager = field(root, 'pager');
    this.buttons = [.../** @type {NodeListOf<HTMLElement>} */ (root.querySelectorAll('[data-tab]'))];
    this.names = this.buttons.map((button) => button.dataset['tab'] ?? '');
    this.tabs = this.buttons.map((button) => ({ name: button.dataset['tab'] ?? '', wide: button.dataset['wide'] ?? '' }));
    this.panels = this.names.map((tab) => /** @type {HTMLElement} */ (root.querySelector(`[data-panel="${tab}"]`)));
    this.onFront = onFront;
    const wanted = tabByHash(location.hash, this.names);
    this.index = wanted >= 0 ? wanted : Math.max(0, this.names.indexOf(remembered() ?? ''));
    this.stops = [
      ...this.buttons.map((button, i) => listen(button, 'click', () => this.go(i))),
      ...this.buttons.map((button) => listen(button, 'keydown', (event) => this.#key(event))),
      listen(this.pager, 'scroll', () => this.#scrolled(), { passive: true }),
      listen(this.pager, 'pointerdown', () => this.#unfold(), { passive: true }),
      listen(this.pager, 'wheel', () => this.#unfold(), { passive: true }),
      listen(window, 'hashchange', () => this.#linked()),
      listen(floorQuery(), 'change', () => this.#relaid()),
      listen(window, 'resize', () => root.hidden || this.place()), // a page that begins gets this event too: nothing is shown yet
    ];
    this.#bring(this.#laid(this.index));
    this.#fold();
  }

  /** Unmount. */
  stop() {
    clearTimeout(this.#folding);
    for (const stop of this.stops) stop();
  }

  /** The pager has a size only once it is shown: put the tab in front where it belongs, without a movement. */
  place() {
    const isThere = isFloor() || (this.index === 0 && !this.#isPlaced); // no need to have it all laid out for that
    if (!isThere && !this.pager.clientWidth) return;
    if (!isThere) this.pager.scrollTo({ left: this.#leftOf(this.index), behavior: 'instant' });
    this.#isPlaced = true;
    this.#still();
    this.#fold();
    this.onFront();
  }

  /** A pane has no tab of its own where all stand side by side: Home's stands for it. @param {number} index */
  #laid(index) {
    return isFloor() && this.tabs[index]?.wide === 'pane' ? 0 : index;
  }

  /** The window became a floor, or is one no more. */
  #relaid() {
    this.#bring(this.#laid(this.index));
    this.place();
  }

  /** What is out of sight is out of reach of keys and readers. */
  #still() {
    this.panels.forEach((panel, i) => setAttribute(panel, 'inert', !this.shows(this.names[i] ?? '')));
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
   * @param {number} wanted
   */
  go(wanted) {
    const index = this.#laid(wanted);
    if (isFloor()) {
      this.#bring(index);
      this.#fold();
      return;
    }
    this.#unfold();
    this.#bring(index);
    const isStill = matchMedia('(prefers-reduced-motion: reduce)').matches;
    this.pager.scrollTo({ left: this.#leftOf(index), behavior: isStill ? 'instant' : 'smooth' });
    this.#aim = index;
  }

  /** Is any of this tab to be seen? @param {string} tab */
  shows(tab) {
    return tabsInSight(this.tabs, this.index, isFloor(), isWall()).includes(tab);
  }

  /** The tabs that have a key now, from the left. */
  get order() {
    return this.tabs.map((_, i) => i).filter((i) => this.#laid(i) === i);
  }

  get front() {
    return this.names[this.index] ?? '';
  }

  /** Where a press is scrolling to; what it passes on its way is not in front. @type {number | null} */
  #aim = null;

  /** @param {number} index */
  #leftOf(index) {
    return (this.panels[index]?.offsetLeft ?? 0) - (this.panels[0]?.offsetLeft ?? 0);
  }

  #scrolled() {
    if (!this.#isPlaced || isFloor() || !this.pager.clientWidth) return;
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
    const { order } = this;
    const place = tabByKey(event.key, order.indexOf(this.index), order.length - 1);
    if (place === null) return;
    const index = order[place] ?? 0;
    event.preventDefault();
    this.go(index);
    this.buttons[index]?.focus();
  }

  #linked() {
    const index = tabByHash(location.hash, this.names);
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
    setAttribute(this.root, 'data-front', this.names[index] ?? '');
    setAttribute(this.root, 'data-wide', this.tabs[index]?.wide ?? '');
    this.#still();
    const tab = this.names[index] ?? '';
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
