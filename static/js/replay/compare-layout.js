// Two recordings on one time line: where each begins on it, the commands to each, and the texts. Pure functions, no DOM.

import { lineOf } from '../home/drive-layout.js';
import { counted, duration, fixed } from '../core/format.js';

/** Two recordings always share so much of the time line [s], so that it has no hole in which neither is. */
const LEAST_SHARED_S = 1;
/** A car that is faster than this moves [m/s]. */
const MOVES_MPS = 0.5;
/** So far two sides may be apart while both stand [s]; while they play, a frame's way is added. */
const STANDS_S = 0.02;
const PLAYS_S = 0.25;
const PLAYS_PER_RATE_S = 0.15;
/** Nearer to its end than this a recording is over: to play it would begin it anew [s]. */
const END_S = 0.05;
/** So far beyond its end a side may still be on its way there [s]. */
const ENDS_S = 2;

/**
 * @typedef {import('../home/drive-layout.js').Answer} Answer
 * @typedef {import('../home/drive-layout.js').Mark} Mark
 * @typedef {import('../core/protocol-types.js').ReplayState} ReplayState
 * @typedef {{start_ms: number, length_s: number}} Extent
 * @typedef {'a' | 'b'} Name
 * @typedef {{kind: 'in' | 'before' | 'after', by_s: number}} Place by_s: how far outside
 * @typedef {{do: 'seek', at_s: number} | {do: 'play'} | {do: 'pause'} | {do: 'rate', rate: number}} Order
 */

/** The time line: from the first beginning to the last end. Zero is where A begins. @param {Extent} a @param {Extent} b @param {number} shift_s where B begins @returns {[number, number]} */
export function unionOf(a, b, shift_s) {
  return [Math.min(0, shift_s), Math.max(a.length_s, shift_s + b.length_s)];
}

/** A shift by which both share a part of the time line. @param {number} shift_s @param {Extent} a @param {Extent} b */
export function sharing(shift_s, a, b) {
  const shared_s = Math.min(LEAST_SHARED_S, a.length_s, b.length_s);
  return Math.round(Math.min(Math.max(shift_s, shared_s - b.length_s), a.length_s - shared_s) * 100) / 100;
}

/** Where a moment of the time line is in a recording that begins at `begin_s`. @param {number} at_s @param {number} begin_s @param {number} length_s @returns {Place} */
export function placeOf(at_s, begin_s, length_s) {
  const own_s = at_s - begin_s;
  if (own_s < -1e-6) return { kind: 'before', by_s: -own_s };
  if (own_s > length_s + 1e-6) return { kind: 'after', by_s: own_s - length_s };
  return { kind: 'in', by_s: 0 };
}

/** By the clocks on the wall, where both recordings were made at the same time; null: they were not. @param {Extent} a @param {Extent} b @returns {number | null} */
export function clockShift(a, b) {
  const shift_s = (b.start_ms - a.start_ms) / 1000;
  return shift_s < a.length_s && shift_s + b.length_s > 0 ? sharing(shift_s, a, b) : null;
}

/** By the first alarm of A that B has too; null: they have none in common. @param {Mark[]} a @param {Mark[]} b @returns {{shift_s: number, title: string} | null} */
export function alarmShift(a, b) {
  for (const mark of a) {
    const same = b.find(({ alarm }) => alarm === mark.alarm);
    if (same) return { shift_s: mark.at_s - same.at_s, title: mark.title };
  }
  return null;
}

/** The bucket in which a car first moves; null: it never does. @param {Answer} answer with its speed @returns {[number, number] | null} */
export function firstMotion(answer) {
  const { highest = [], lowest = [] } = answer.signals['speed'] ?? {};
  const i = highest.findIndex((high, n) => Math.max(high ?? 0, -(lowest[n] ?? 0)) > MOVES_MPS);
  return i < 0 ? null : [answer.from_s + i * answer.step_s, answer.from_s + (i + 1) * answer.step_s];
}

/**
 * What one recording is ordered so that it comes to a moment of its own and goes on as wanted.
 * @param {ReplayState} side
 * @param {{at_s: number, isPlaying: boolean, rate: number}} want at_s: of its own, perhaps outside
 * @returns {Order[]}
 */
export function ordersOf({ at_s, length_s, is_playing, is_seeking, rate }, want) {
  const target_s = Math.min(Math.max(want.at_s, 0), length_s);
  const goes = want.isPlaying && want.at_s >= 0 && want.at_s < length_s - END_S;
  const isEnding = want.isPlaying && is_playing && !goes && want.at_s >= 0 && want.at_s < length_s + ENDS_S; // it stops by itself
  /** @type {Order[]} */
  const orders = [];
  if (rate !== want.rate) orders.push({ do: 'rate', rate: want.rate });
  if (isEnding) return orders;
  if (!goes && is_playing) orders.push({ do: 'pause' });
  const allowed_s = goes && is_playing ? PLAYS_S + PLAYS_PER_RATE_S * want.rate : STANDS_S;
  const isAtEnd = goes && !is_playing && at_s >= length_s - END_S; // played there it would begin anew
  if (isAtEnd || (!is_seeking && Math.abs(at_s - target_s) > allowed_s)) orders.push({ do: 'seek', at_s: Math.round(target_s * 1000) / 1000 });
  if (goes && !is_playing) orders.push({ do: 'play' });
  return orders;
}

/** Which recording leads the time line while both play: A, or B where A has not begun or is over; null: neither is there. @param {number} at_s @param {Extent} a @param {Extent} b @param {number} shift_s @returns {Name | null} */
export function leaderAt(at_s, a, b, shift_s) {
  if (at_s >= 0 && at_s < a.length_s - END_S) return 'a';
  return at_s >= shift_s && at_s < shift_s + b.length_s - END_S ? 'b' : null;
}

/** "0:12.3" on the time line, before its zero "−0:05.0". @param {number} at_s */
export function lineTime(at_s) {
  const tenths = Math.round(Math.abs(at_s) * 10);
  return `${at_s < 0 && tenths ? '−' : ''}${duration(Math.floor(tenths / 10))}.${tenths % 10}`;
}

/** @param {number} shift_s */
export function shiftWords(shift_s) {
  if (Math.abs(shift_s) < 0.005) return 'B begins with A';
  const by = Math.abs(shift_s) < 60 ? `${fixed(Math.abs(shift_s), Number.isInteger(Math.round(shift_s * 100) / 10) ? 1 : 2)} s` : lineTime(Math.abs(shift_s));
  return `B begins ${by} ${shift_s > 0 ? 'after' : 'before'} A`;
}

/**
 * What is missing of a recording at a moment; '': nothing.
 * @param {Place} place
 * @param {ReplayState} replay
 */
export function missingWords(place, { hangs_s, is_seeking, silent_s, is_settled }) {
  if (place.kind === 'before') return `Not begun: it begins ${lineTime(place.by_s)} later`;
  if (place.kind === 'after') return `Ended ${lineTime(place.by_s)} earlier`;
  if (hangs_s) return `No answer for ${hangs_s.toFixed(0)} s`;
  if (is_seeking) return 'Seeking';
  if (silent_s === null) return 'No message from the car yet';
  if (silent_s > 1) return `Nothing recorded for ${fixed(silent_s)} s`;
  return is_settled ? '' : 'Checks still warming up';
}

/** "21 OK, 2 not, 1 not checked". @param {Pick<import('../core/protocol-types.js').Tile, 'verdict'>[]} checks */
export function checkWords(checks) {
  const [ok, fault, unknown] = ['ok', 'fault', 'unknown'].map((verdict) => checks.filter((check) => check.verdict === verdict).length);
  return [ok ? `${ok} OK` : '', fault ? counted(fault, 'fault') : '', unknown ? `${unknown} not checked` : ''].filter(Boolean).join(', ');
}

/**
 * Where a recording has nothing, on the time line: before it begins, after it ends, where no message came; with the reason as a short text.
 * @param {Answer | null} answer
 * @param {string} signal
 * @param {number} begin_s
 * @param {number} length_s
 * @returns {{from_s: number, to_s: number, why: string}[]}
 */
export function holesOf(answer, signal, begin_s, length_s) {
  const holes = [{ from_s: -Infinity, to_s: begin_s, why: 'not begun' }, { from_s: begin_s + length_s, to_s: Infinity, why: 'ended' }];
  if (!answer) return holes;
  const trend = answer.signals[signal];
  if (lacks(answer, signal)) return [{ from_s: -Infinity, to_s: Infinity, why: 'not recorded' }];
  for (const [from_s, to_s] of [...answer.blind, ...(trend?.gaps ?? [])]) holes.push({ from_s: begin_s + from_s, to_s: begin_s + to_s, why: 'no data' });
  if (!answer.is_sketch && answer.known_s < length_s - 0.5) holes.push({ from_s: begin_s + answer.known_s, to_s: begin_s + length_s, why: 'not read yet' });
  return holes;
}

/** Does a recording that was read to its end have nothing of a signal? @param {Answer} answer @param {string} signal */
export function lacks({ offered, is_sketch, known_s, length_s }, signal) {
  return offered[signal] !== undefined && !offered[signal].has_data && !is_sketch && known_s >= length_s - 0.5;
}

/** A signal of one side as a line on the time line. @param {Answer | null} answer @param {string} signal @param {number} begin_s */
export function courseOf(answer, signal, begin_s) {
  const trend = answer?.signals[signal];
  if (!answer || !trend) return { times_s: [], lowest: [], highest: [] };
  const line = lineOf(trend, answer);
  return { ...line, times_s: line.times_s.map((at_s) => at_s + begin_s) };
}

/** Where a key leads on the time line; null: nowhere. @param {string} key @param {number} at_s @param {[number, number]} union */
export function lineByKey(key, at_s, [from_s, to_s]) {
  const step_s = Math.max(1, Math.min(5, (to_s - from_s) / 20));
  const leap = /** @type {Record<string, number>} */ ({ ArrowRight: step_s, ArrowLeft: -step_s, '.': 0.1, ',': -0.1, PageUp: 6 * step_s, PageDown: -6 * step_s, Home: -Infinity, End: Infinity })[key];
  return leap === undefined ? null : Math.min(Math.max(at_s + leap, from_s), to_s);
}

/** By how much a key moves B along the time line [s]; null: it does not. @param {string} key */
export function shiftByKey(key) {
  return /** @type {Record<string, number>} */ ({ '[': -0.1, ']': 0.1, '{': -1, '}': 1 })[key] ?? null;
}
