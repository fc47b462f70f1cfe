// One check as text and numbers: its answer, its three numbers, its alarms in this drive, the scale of its minute. Pure functions, no DOM.

import { shownIn } from '../core/units.js';
import { age, ageWords, counted, fixed, timeOfDay } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').CheckAnswer} Answer
 * @typedef {import('../core/protocol-types.js').StandingAlarm} Alarm
 * @typedef {import('../core/protocol-types.js').LogEvent} Event
 * @typedef {import('../core/protocol-types.js').Verdict} Verdict
 * @typedef {{label: string, value: string, unit: string, isLimit?: boolean}} Figure
 * @typedef {{at_ms: number, ended_ms: number | null, worst: number | null, unit: string, side: 'above' | 'below', by: string | null, took_s: number | null}} Episode
 */

export const TAGS = /** @type {Record<Verdict, string>} */ ({ ok: 'OK', fault: 'FAULT', unknown: 'NOT CHECKED' });

/**
 * Measured, allowed, and for how long. A number that is not known is a dash.
 * @param {Answer | null} answer
 * @param {Alarm | null} alarm the one that stands
 * @param {boolean} isKnown false: nothing of it is live
 * @returns {Figure[]}
 */
export function figuresOf(answer, alarm, isKnown) {
  const isAlarmed = alarm !== null && alarm.verdict === 'fault';
  const measured = isAlarmed ? alarm.measured : answer?.measured;
  const limit = (isAlarmed ? alarm.limit : null) ?? answer?.limit;
  const verdict = isKnown ? (isAlarmed ? 'fault' : answer?.verdict ?? 'unknown') : 'unknown';
  const for_s = isAlarmed && alarm.active ? alarm.for_s : answer?.for_s;
  const isAbove = (measured?.value ?? 0) >= (limit?.value ?? 0);
  const lasting = verdict === 'ok' ? 'OK for' : verdict === 'unknown' ? 'Not checked for' : !measured || !limit ? 'Fault for' : isAbove ? 'Above for' : 'Below for';
  return [
    figure(measured?.label ?? 'Measured', isKnown && verdict !== 'unknown' ? measured : null),
    { ...figure(limit?.label ?? 'Limit', isKnown ? limit : null), isLimit: true },
    { label: lasting, ...lasted(isKnown ? for_s : null) },
  ];
}

/** @param {string} label @param {{value: number | null, unit: string} | null | undefined} quantity @returns {Figure} */
function figure(label, quantity) {
  if (!quantity || quantity.value === null) return { label, value: '–', unit: '' };
  const { value, unit } = shownIn(quantity.value, quantity.unit);
  return { label, value: fixed(value), unit };
}

/** @param {number | null | undefined} seconds */
function lasted(seconds) {
  return { value: age(seconds), unit: typeof seconds === 'number' && seconds < 59.95 ? 's' : '' };
}

/**
 * When the alarm begins and ends. @param {Pick<Answer, 'delays' | 'ends'>} answer
 */
export function thresholdWords({ delays, ends }) {
  const end = ends && ends.value !== null ? shownIn(ends.value, ends.unit) : null;
  const at = end && ends ? ` ${ends.side} ${fixed(end.value)} ${end.unit}` : '';
  return `alarm after ${delays.on_s} s, ends${at} after ${delays.off_s} s`;
}

/**
 * How far the tiles are behind this check: the tile it belongs to, and how many there are.
 * @param {{label: string, ids: string[]}[]} tiles
 * @param {string} id
 */
export function placeOf(tiles, id) {
  const at = tiles.findIndex(({ ids }) => ids.includes(id));
  return { at, before: tiles[at - 1] ?? null, after: at < 0 ? null : tiles[at + 1] ?? null, of: tiles.length };
}

const WORSE = { fault: 2, unknown: 1, ok: 0 };

/**
 * Which check of a tile is meant by a press on the tile: the one that made it what it shows.
 * @param {{id: string, verdict: Verdict}[]} checks
 * @param {Verdict} verdict of the tile
 */
export function meantOf(checks, verdict) {
  return (checks.find((check) => check.verdict === verdict) ?? [...checks].sort((a, b) => WORSE[b.verdict] - WORSE[a.verdict])[0])?.id ?? null;
}

/**
 * The alarms of one check, newest first, from its events in the log.
 * @param {Event[]} events in any order
 * @returns {Episode[]}
 */
export function episodesOf(events) {
  /** @type {Episode[]} */
  const found = [];
  let announced_ms = 0;
  for (const event of [...events].sort((a, b) => a.n - b.n)) {
    const standing = found.at(-1)?.ended_ms === null ? found.at(-1) : undefined;
    if (event.change === 'raised') {
      found.push({ at_ms: event.at_ms, ended_ms: null, worst: null, unit: '', side: 'above', by: null, took_s: null });
    } else if (!standing && event.change !== 'acknowledged') continue;
    if (event.change === 'raised' || event.change === 'recaused' || event.change === 'unshelved') announced_ms = event.at_ms;
    const one = found.at(-1);
    if (!one) continue;
    if (event.worst && event.worst.value !== null) Object.assign(one, { worst: event.worst.value, unit: event.worst.unit, side: event.worst.side });
    if (event.change === 'cleared') one.ended_ms = event.at_ms;
    if (event.change === 'acknowledged' && one.by === null) Object.assign(one, { by: event.by, took_s: Math.max(0, (event.at_ms - announced_ms) / 1000) });
  }
  return found.reverse();
}

/**
 * One of them as a row: when, what, how long.
 * @param {Episode} episode
 * @param {number} now_ms by the server's clock
 */
export function episodeWords({ at_ms, ended_ms, worst, unit, side, by, took_s }, now_ms) {
  const parts = [
    ended_ms === null ? 'active' : '',
    worst === null ? '' : `${side === 'above' ? 'highest' : 'lowest'} ${fixed(worst)} ${unit}`.trim(),
    by === null ? (ended_ms === null ? '' : 'not acknowledged') : `acknowledged by ${by} after ${ageWords(took_s ?? 0)}`,
  ];
  const lasted_s = ((ended_ms ?? now_ms) - at_ms) / 1000;
  return { at: timeOfDay(at_ms), text: parts.filter(Boolean).join(', ') || 'ended', lasted: ageWords(lasted_s) };
}

/** "3 times, 18.4 s in all". @param {Episode[]} episodes @param {number} now_ms */
export function totalWords(episodes, now_ms) {
  if (!episodes.length) return 'no alarm';
  const all_s = episodes.reduce((sum, { at_ms, ended_ms }) => sum + Math.max(0, (ended_ms ?? now_ms) - at_ms) / 1000, 0);
  return `${counted(episodes.length, 'time')}, ${ageWords(all_s)} in all`;
}

/**
 * The lower and the upper end of the scale of a minute: zero, what was measured and what is allowed are within.
 * @param {(number | null)[]} values
 * @param {(number | null)[]} limits
 * @returns {[number, number]}
 */
export function endsOf(values, limits) {
  const known = [...values, ...limits].filter((value) => value !== null);
  const [low, high] = [Math.min(0, ...known), Math.max(0, ...known)];
  const span = high - low || 1;
  const step = 10 ** Math.floor(Math.log10(span)) / 2;
  const out = (/** @type {number} */ end) => (end === 0 ? 0 : Math.sign(end) * Math.ceil((Math.abs(end) + span * 0.08) / step) * step);
  return [out(low), out(high) || 1];
}

/**
 * Which of some steps are unknown, as bands of first and last step, the last excluded.
 * @param {(number | null)[]} values
 */
export function gapsOf(values) {
  /** @type {[number, number][]} */
  const gaps = [];
  values.forEach((value, i) => {
    if (value !== null) return;
    const last = gaps.at(-1);
    if (last && last[1] === i) last[1] = i + 1;
    else gaps.push([i, i + 1]);
  });
  return gaps;
}
