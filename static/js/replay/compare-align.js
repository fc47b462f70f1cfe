// By what two recordings are aligned on their time line, and why they cannot be.

import { alarmShift, clockShift, firstMotion } from './compare-layout.js';

/**
 * @typedef {import('./compare-layout.js').Name} Name
 * @typedef {Record<Name, import('./compare-feed.js').SideFeed>} Feeds
 * @typedef {Record<Name, import('./compare-layout.js').Extent>} Extents
 */

/** How often the first motion is narrowed down. */
const TRIES = 4;

/** @param {Feeds} feeds @param {Extents} extents @returns {Record<string, string>} why not; '': it can be */
export function cannotAlign(feeds, { a, b }) {
  return {
    clock: clockShift(a, b) === null ? 'They were not recorded at the same time' : '',
    alarm: common(feeds) ? '' : 'They have no alarm in common',
  };
}

/**
 * Where B begins on the time line [s], or in a sentence why that is not known.
 * @param {string} how
 * @param {Feeds} feeds
 * @param {Extents} extents
 * @returns {Promise<{shift_s: number} | string>}
 */
export async function shiftBy(how, feeds, { a, b }) {
  if (how === 'clock') return { shift_s: clockShift(a, b) ?? 0 };
  if (how === 'alarm') return { shift_s: common(feeds)?.shift_s ?? 0 };
  if (how !== 'motion') return { shift_s: 0 };
  const [first, second] = await Promise.all([motionOf(feeds.a, a.length_s), motionOf(feeds.b, b.length_s)]);
  if (first !== null && second !== null) return { shift_s: first - second };
  const [name, feed] = first === null ? ['A', feeds.a] : ['B', feeds.b];
  return `Recording ${name} shows no motion${/** @type {import('./compare-feed.js').SideFeed} */ (feed).isWhole ? '' : ' as far as it has been read'}.`;
}

/** @param {Feeds} feeds */
function common({ a, b }) {
  return alarmShift(a.overview?.marks ?? [], b.overview?.marks ?? []);
}

/** When a car first moves, as narrow as the server has it. @param {import('./compare-feed.js').SideFeed} feed @param {number} length_s */
async function motionOf(feed, length_s) {
  /** @type {[number, number]} */
  let part = [0, length_s];
  for (let tries = 0; tries < TRIES; tries += 1) {
    const answer = await feed.speed(...part);
    const found = answer && firstMotion(answer);
    if (!answer || !found) return tries ? part[0] : null;
    part = found;
    if (answer.step_s <= 0.25 || answer.is_sketch) break;
  }
  return part[0];
}
