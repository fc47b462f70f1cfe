// The texts of who is on duty: pure functions of what the server sent.

import { timeOfDay } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').Duty} Duty
 * @typedef {import('../core/protocol-types.js').HandoverState} HandoverState
 */

/** "AK" of "A. K.", "Anna Keller" or "anna"; of other scripts their first letters. @param {string} name */
export function initialsOf(name) {
  const parts = name.split(/[\s.\-_,]+/u).map((part) => [...part].find((letter) => /[\p{L}\p{N}]/u.test(letter)) ?? '').filter(Boolean);
  const [first = '?', last = ''] = [parts[0], parts.length > 1 ? parts.at(-1) : ''];
  return (first + last).toLocaleUpperCase('en');
}

/** The key that leads to who is on duty. @param {Duty | null} duty */
export function dutyWords(duty) {
  if (!duty) return 'On duty: not known';
  if (duty.me) return `${duty.me.name}, ${duty.me.title}: on duty since ${timeOfDay(duty.me.since_ms).slice(0, 5)}`;
  return duty.people ? 'Sign on: nobody is on duty here' : 'Sign on: the list of people is empty';
}

/** What this page has to do with a hand-over. @param {HandoverState | null | undefined} handover @param {string} page @returns {'taker' | 'giver' | null} */
export function partOf(handover, page) {
  if (!handover || !page) return null;
  return handover.page === page ? 'taker' : handover.by_page === page ? 'giver' : null;
}

/** For how long after a duty began it is shown what others left: a car knows of the end of another duty only by the next status of a page. */
const LEFT_WITHIN_MS = 10_000;

/** Whether who signs on is to be shown what people who are off duty left acknowledged: once in a duty. */
export class LeftNotice {
  isShown = false;
  #since_ms = 0;
  #until_ms = 0;
  #isDue = false;

  /** @param {number} since_ms when the duty began, by the server @param {boolean} isLeft @param {number} now_ms by a clock of the page */
  isDue(since_ms, isLeft, now_ms) {
    if (since_ms !== this.#since_ms) {
      this.#since_ms = since_ms;
      this.#until_ms = now_ms + LEFT_WITHIN_MS;
      this.#isDue = this.isShown = false;
    }
    if (isLeft && now_ms <= this.#until_ms) this.#isDue = true;
    return isLeft && this.#isDue && !this.isShown;
  }
}
