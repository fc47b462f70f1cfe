// Back closes what is open and then leads to the first tab; only where nothing is open does it leave the page. While there is
// something to close, an entry of the history that shows the same (`over`) is what Back takes away.

import { listen } from '../core/dom.js';

const OPEN = 'dialog[open]:not([data-docked])'; // what is docked covers nothing

/**
 * Whether the history needs an entry for Back to take away.
 * @param {{isOpen: boolean, isFirstTab: boolean, state: Record<string, unknown> | null}} page isOpen: a sheet or a dialog is
 */
export function isWanted({ isOpen, isFirstTab, state }) {
  const hasOwn = Object.keys(state ?? {}).some((key) => key !== 'over' && key !== 'depth'); // screens and boards have entries of their own
  return isOpen || (!isFirstTab && !hasOwn);
}

/**
 * @param {HTMLElement} monitor
 * @param {import('./tabs.js').Tabs} tabs
 */
export function mount(monitor, tabs) {
  const { navigation } = /** @type {{navigation?: {currentEntry: {index: number} | null} & EventTarget}} */ (/** @type {unknown} */ (window));
  if (!navigation) return () => {}; // nothing tells Back from a link
  const at = () => navigation.currentEntry?.index ?? 0;
  /** Open dialogs, the last opened last. @type {HTMLDialogElement[]} */
  let open = [];
  let index = at();
  /** Why the history goes back, where it is by this module. @type {'tidying' | 'leaving' | null} */
  let own = null;
  /** A screen or a board lay over the page, when all was at rest last. */
  let isCovered = false;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;
  const isFirstTab = () => Boolean(monitor.hidden) || tabs.index === 0;

  function look() {
    const now = /** @type {HTMLDialogElement[]} */ ([...document.querySelectorAll(OPEN)]);
    open = [...open.filter((one) => now.includes(one)), ...now.filter((one) => !open.includes(one))];
    clearTimeout(timer);
    timer = setTimeout(agree); // after whatever is being opened or closed has its own entry
  }

  /** Let the history have the entry exactly where it is wanted. */
  function agree() {
    if (own === 'tidying') return; // it is under way
    own = null; // there was nowhere to leave to
    isCovered = Boolean(monitor.dataset['over']) || document.querySelector('.drive-board, .saved-board') !== null;
    const { state } = history;
    const isThere = state?.over === true;
    const wanted = isWanted({ isOpen: open.length > 0, isFirstTab: isFirstTab(), state });
    if (wanted && !isThere) history.pushState({ ...state, over: true }, '');
    else if (!wanted && isThere) backBy('tidying');
    index = at();
  }

  /** @param {'tidying' | 'leaving'} why */
  function backBy(why) {
    own = why;
    history.back();
  }

  /** @param {PopStateEvent} event */
  function popped(event) {
    const isBack = at() < index;
    const why = own;
    index = at();
    own = null;
    const top = open.at(-1);
    if (!isBack) look();
    else if (why === 'leaving') backBy('leaving');
    else if (why === 'tidying') look();
    else if (top) {
      event.stopImmediatePropagation(); // what lies beneath stays
      if (top.dispatchEvent(new Event('cancel', { cancelable: true }))) top.close();
      look();
    } else if (isCovered) look(); // it closes itself
    else if (!isFirstTab()) tabs.go(0);
    else backBy('leaving'); // an entry of what was closed in another way
  }

  if (history.state?.over) history.replaceState({ ...history.state, over: undefined }, ''); // of the page before a reload
  const [opened, made, front] = [new MutationObserver(look), new MutationObserver(look), new MutationObserver(look)]; // one target, one set of options each
  opened.observe(document.body, { subtree: true, attributeFilter: ['open'] });
  made.observe(document.body, { childList: true }); // a sheet that is taken away while it is open
  front.observe(monitor, { attributeFilter: ['data-front', 'data-over', 'hidden'] });
  look();
  const stop = listen(window, 'popstate', popped, { capture: true });
  return () => {
    stop();
    for (const one of [opened, made, front]) one.disconnect();
    clearTimeout(timer);
  };
}
