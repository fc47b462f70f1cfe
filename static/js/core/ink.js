// Writes a value with the ink it deserves: solid, dotted, hatched, or none at all.

import { setAttribute, setText } from './dom.js';
import { age } from './format.js';

/** @typedef {import('./freshness.js').Ink} Freshness */

/** @typedef {'not_measured' | 'no_value' | 'never' | 'not_published' | 'not_chosen' | 'not_in_unit'} Absent */

/** What stands in the place of a value that never came. */
export const ABSENT = /** @type {Record<Absent, string>} */ ({
  not_measured: 'not measured', no_value: 'no value', never: 'no message yet', not_published: 'not published',
  not_chosen: 'not chosen', not_in_unit: 'unit unknown',
});

/** @param {Freshness} ink @returns {ink is Absent} */
export const isAbsent = (ink) => ink in ABSENT;

/**
 * Write `text` as a value of this freshness; where there is none, write that as text and never 0.
 * @param {HTMLElement} element of class n
 * @param {Freshness} ink
 * @param {string} text
 * @param {HTMLElement} [unit] written beside it, empty where there is no value
 * @param {string} [unitText]
 */
export function write(element, ink, text, unit, unitText = '') {
  setAttribute(element, 'data-ink', ink);
  setText(element, isAbsent(ink) ? ABSENT[ink] : text);
  if (unit) setText(unit, isAbsent(ink) ? '' : unitText);
}

/**
 * The age of a value beside its heading: plain while fresh, bold while ageing, STALE after.
 * @param {HTMLElement} element
 * @param {{ink: Freshness, age_s: number | null}} state
 */
export function writeAge(element, { ink, age_s }) {
  setAttribute(element, 'data-ink', ink);
  if (isAbsent(ink)) return setText(element, ABSENT[ink]);
  return setText(element, `${ink === 'stale' ? 'STALE ' : ''}${age(age_s, 2)} s`);
}
