// Which signals the chart of the drive shows: up to four, kept on this phone; any part of the page may add one.

import { openScreen } from '../core/open-screen.js';

const KEPT = 'catgraph.trends';
export const MOST = 4;
const FIRST = ['speed', 'distance', 'brake', 'steering'];

/** @type {string[]} */
let chosen = kept();

/** The signals in the order of their panes. */
export function chosenSignals() {
  return chosen;
}

/** @param {string[]} names at least one, at most four */
export function chooseSignals(names) {
  chosen = names.slice(0, MOST);
  try {
    localStorage.setItem(KEPT, JSON.stringify(chosen));
  } catch {
    // no storage: it holds until the page is loaded again
  }
  window.dispatchEvent(new Event('catgraph-trends'));
}

/**
 * The choice with a signal first: one that is shown moves up, otherwise the last one gives way.
 * @param {string[]} names
 * @param {string} name
 */
export function withFirst(names, name) {
  return [name, ...names.filter((one) => one !== name)].slice(0, MOST);
}

/** Opens the chart of the drive with a signal first. @param {string} name */
export function showInTrends(name) {
  chooseSignals(withFirst(chosen, name));
  if (!document.querySelector('.trends-here > .trends')?.checkVisibility()) openScreen('trends');
}

/** @returns {string[]} */
function kept() {
  try {
    const names = JSON.parse(localStorage.getItem(KEPT) ?? 'null');
    if (Array.isArray(names) && names.length && names.every((name) => typeof name === 'string' && /^[a-z_]{1,30}$/.test(name))) return names.slice(0, MOST);
  } catch {
    // no storage, or nothing that can be read
  }
  return FIRST;
}
