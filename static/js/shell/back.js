// Back closes what is open and then leads to the first tab; only where nothing is open does it leave the page. While there is
// something to close, an entry of the history that shows the same (`over`) is what Back takes away. Where more is left to close
// after a Back, the page returns to that entry: browsers pass over entries between which a page added one without a touch.

import { listen, need } from '../core/dom.js';
import { isAsked } from './sheet.js';

const OPEN = 'dialog[open]:not([data-docked], [data-slot] > dialog)'; // what is docked or stands in its pane covers nothing
const BOARDS = '.drive-board, .saved-board';

/**
 * Whether the history needs an entry for Back to take away.
 * @param {{isOpen: boolean, isFirstTab: boolean, state: Record<string, unknown> | null}} page isOpen: a sheet or a dialog is
 */
export function isWanted({ isOpen, isFirstTab, state }) {
  const hasOwn = Object.keys(state ?? {}).some((key) => key !== 'over' && key !== 'depth'); // screens and boards have entries of their own
  return isOpen || (!isFirstTab && !hasOwn);
}

/** @param {HTMLElement} monitor @param {import('./tabs.js').Tabs} tabs */
export function mount(monitor, tabs) {
  const { navigation } = /** @type {{navigation?: Navigated}} */ (/** @type {unknown} */ (window));
  if (!navigation) return () => {}; // nothing tells Back from a link
  const back = new Back(monitor, tabs, navigation);
  const [opened, made, front] = [0, 1, 2].map(() => new MutationObserver(() => back.look())); // one target, one set of options each
  opened?.observe(document.body, { subtree: true, attributeFilter: ['open'] });
  for (const place of [document.body, need(monitor, '.view')]) made?.observe(place, { childList: true }); // a board, or a sheet that is taken away while it is open
  front?.observe(monitor, { attributeFilter: ['data-front', 'data-over', 'hidden'] });
  const stop = listen(window, 'popstate', (event) => back.popped(event), { capture: true });
  return () => {
    stop();
    for (const one of [opened, made, front]) one?.disconnect();
  };
}

/** @typedef {{currentEntry: {index: number} | null, entries: () => {url: string | null}[]}} Navigated */

class Back {
  /** Open dialogs, the last opened last. @type {HTMLDialogElement[]} */
  #open = [];
  #index;
  /** Why the history moves, where it is by this module. @type {'tidying' | 'leaving' | 'returning' | null} */
  #own = null;
  /** The newest Back left an entry of this module, to which the page can return. */
  #canReturn = false;
  /** The entry that was shown when all was at rest last is one of this module. */
  #isGuarded = false;
  /** Whether a screen or a board covered the page before: a screen receives Back before this module. */
  #wasCovered = false;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #timer;

  /** @param {HTMLElement} monitor @param {import('./tabs.js').Tabs} tabs @param {Navigated} navigation */
  constructor(monitor, tabs, navigation) {
    this.monitor = monitor;
    this.tabs = tabs;
    this.navigation = navigation;
    this.#index = this.#at;
    if (history.state?.over) history.replaceState({ ...history.state, over: undefined }, ''); // of the page before a reload
    this.look();
  }

  get #at() {
    return this.navigation.currentEntry?.index ?? 0;
  }

  get #isFirstTab() {
    return Boolean(this.monitor.hidden) || this.tabs.index === 0;
  }

  /** A screen or a board lies over the page. */
  get #isCovered() {
    return Boolean(this.monitor.dataset['over']) || document.querySelector(BOARDS) !== null;
  }

  /** Something was opened or closed. */
  look() {
    const now = /** @type {HTMLDialogElement[]} */ ([...document.querySelectorAll(OPEN)]);
    this.#open = [...this.#open.filter((one) => now.includes(one)), ...now.filter((one) => !this.#open.includes(one))];
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#agree()); // after whatever is being opened or closed has its own entry
  }

  /** Let the history have the entry exactly where it is wanted. */
  #agree() {
    if (this.#own === 'tidying' || this.#own === 'returning') return; // it is under way
    this.#wasCovered = this.#isCovered;
    this.#own = null; // there was nowhere to leave to
    const { state } = history;
    const isThere = state?.over === true;
    const wanted = isWanted({ isOpen: this.#open.length > 0, isFirstTab: this.#isFirstTab, state });
    if (wanted && !isThere) this.#guard(state);
    else if (!wanted && isThere) this.#goBack('tidying');
    this.#canReturn = false;
    this.#isGuarded = wanted;
    this.#index = this.#at;
  }

  /** @param {Record<string, unknown> | null} state of this entry */
  #guard(state) {
    if (!this.#canReturn) return history.pushState({ ...state, over: true }, '');
    this.#own = 'returning';
    history.forward();
  }

  /** @param {'tidying' | 'leaving'} why */
  #goBack(why) {
    clearTimeout(this.#timer);
    this.#own = why;
    history.back();
  }

  /** The address of the entry that was left goes on: it follows what is shown. @param {number} left its index */
  #carry(left) {
    const url = new URL(this.navigation.entries()[left]?.url ?? location.href);
    if (!this.monitor.hidden) url.hash = this.tabs.front; // the tab of this entry may be another: no link was followed
    history.replaceState(history.state, '', url);
  }

  /** @param {PopStateEvent} event */
  popped(event) {
    const left = this.#index;
    const isBack = this.#at < left;
    const why = this.#own;
    this.#canReturn = why === null && this.#at === left - 1 && this.#isGuarded;
    this.#index = this.#at;
    this.#own = null;
    this.look();
    if (why === 'returning') return event.stopImmediatePropagation(); // it shows the same
    if (!isBack) return;
    this.#carry(left);
    const top = this.#open.at(-1);
    if (why === 'tidying') event.stopImmediatePropagation(); // it closes nothing
    else if (top) {
      event.stopImmediatePropagation(); // what lies beneath stays
      if (isAsked(top) && top.dispatchEvent(new Event('cancel', { cancelable: true }))) top.close(); // an alarm and a lost link are never answered by it
    } else if (why === 'leaving') this.#goBack('leaving');
    else if (this.#wasCovered || this.#isCovered) return; // it closes itself
    else if (!this.#isFirstTab) this.tabs.go(0);
    else this.#goBack('leaving'); // an entry of what was closed in another way
  }
}
