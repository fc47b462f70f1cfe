// Writes a value with the ink it deserves: solid, dotted, hatched, or none at all.

import { setAttribute, setText } from './dom.js';
import { age } from './format.js';

/** @typedef {import('./protocol-types.js').SignalFreshness} Freshness */

/** What stands in the place of a value that never came. */
export const ABSENT = /** @type {Record<'never' | 'not_published', string>} */ ({ never: 'no message yet', not_published: 'not published' });

/**
 * Write `text` as a value of this freshness; where there is none, say so in words and never write 0.
 * @param {HTMLElement} element of class n
 * @param {Freshness} ink
 * @param {string} text
 * @param {HTMLElement} [unit] written beside it, empty where there is no value
 * @param {string} [unitText]
 */
export function write(element, ink, text, unit, unitText = '') {
  const isAbsent = ink === 'never' || ink === 'not_published';
  setAttribute(element, 'data-ink', ink);
  setText(element, isAbsent ? ABSENT[ink] : text);
  if (unit) setText(unit, isAbsent ? '' : unitText);
}

/**
 * The age of a value beside its heading: plain while fresh, bold while ageing, STALE after.
 * @param {HTMLElement} element
 * @param {{ink: Freshness, age_s: number | null}} state
 */
export function writeAge(element, { ink, age_s }) {
  setAttribute(element, 'data-ink', ink);
  if (ink === 'never' || ink === 'not_published') return setText(element, ABSENT[ink]);
  return setText(element, `${ink === 'stale' ? 'STALE ' : ''}${age(age_s, 2)} s`);
}
