// What only the open list of alarms needs: its pages, what one tap answers together, the text of an empty list. Pure functions, no DOM.

import { timeOfDay } from '../core/format.js';

/**
 * @typedef {import('./alarms-layout.js').Alarm} Alarm
 * @typedef {import('./alarms-layout.js').Row} Row
 */

/** So long a row must have been in sight whole before one tap answers it together with others [ms]. */
export const SEEN_MS = 1000;

/**
 * What one tap may acknowledge together although it still stands: all that waits on this page but what is critical, and
 * only once each was in sight for a second, so that no tap answers what came under the finger.
 * @param {Row[]} shown the rows of this page
 * @param {ReadonlyMap<string, number>} since when each came in sight, by its key
 * @param {number} now_ms
 * @returns {{alarms: Alarm[], isReady: boolean}}
 */
export function together(shown, since, now_ms) {
  const waiting = shown.filter(({ kind, priority }) => kind === 'unacknowledged' && priority !== 'critical');
  return {
    alarms: waiting.flatMap(({ alarm }) => alarm ?? []),
    isReady: waiting.every(({ key }) => now_ms - (since.get(key) ?? now_ms) >= SEEN_MS),
  };
}

/**
 * Where each page of a list begins, so that no row is sliced.
 * @param {number[]} heights of the rows
 * @param {number} room
 */
export function pagesOf(heights, room) {
  const pages = [0];
  let used = 0;
  heights.forEach((height, i) => {
    if (i > (pages.at(-1) ?? 0) && used + height > room) {
      pages.push(i);
      used = 0;
    }
    used += height;
  });
  return pages;
}

/**
 * What stands in place of an empty list: "no alarms" only where alarms could have come.
 * @param {{isSilent: boolean, isReplay: boolean, isPaused: boolean, isChecked: boolean}} seen isChecked: messages of the car are judged
 */
export function noneWords({ isSilent, isReplay, isPaused, isChecked }) {
  if (isSilent) return 'Alarms unknown: the server does not answer.';
  if (isPaused) return isReplay ? 'Monitoring was paused: no alarm could be raised.' : 'Monitoring is paused: no alarm can be raised.';
  if (!isChecked) return isReplay ? 'Nothing recorded yet: nothing is checked.' : 'No message from the car: nothing is checked.';
  return isReplay ? 'No alarms at this moment of the recording.' : 'No alarms.';
}

/**
 * What was lately, beneath a list in which nothing waits: which alarm ended last, and how many were announced.
 * @param {import('../core/event-log.js').Row[]} log newest first
 * @param {number | undefined} in_10_min
 */
export function latelyWords(log, in_10_min) {
  const last = log.find(({ event }) => event?.alarm && event.change === 'cleared')?.event;
  return [
    last ? `Last: ${last.title ?? last.alarm}, ended ${timeOfDay(last.at_ms)}.` : '',
    in_10_min ? `In 10 min: ${in_10_min} ${in_10_min === 1 ? 'alarm' : 'alarms'}.` : '',
  ].filter(Boolean).join(' ');
}
