// Two drives beside each other: which place or moment of one belongs to which of the other. Pure.

import { fixed } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').Course} Course
 * @typedef {import('../core/protocol-types.js').CoursePoints} Points
 * @typedef {'way' | 'time'} By
 * @typedef {{t: number, m: number | null, speed: number | null, steering: number | null, follow: number | null, gps: number | null, lat: number | null, lon: number | null}} Point
 * @typedef {object} Row
 * @property {number} x metres or seconds
 * @property {Point} a
 * @property {Point | null} b null: B was not there, or had no data
 * @property {number | null} aside how far B passed beside A [m]; null: not known
 * @typedef {{x: number, text: string, value: string}} Difference
 */

const NEAR_M = 30; // farther from A it is another way
const AHEAD = 60; // points of B that are looked at for the next place
const EARTH_M = 6_371_008;

/** @param {Course} a @param {Course} b @param {By} by @returns {Row[]} */
export function aligned(a, b, by) {
  return by === 'time' ? byTime(a, b) : byWay(a, b);
}

/** @param {Course} a @param {Course} b @returns {Row[]} */
function byTime(a, b) {
  return a.time.t.map((x, i) => {
    const j = Math.round(x / b.step_s);
    const found = j < b.time.t.length ? pointOf(b.time, j) : null;
    const at = pointOf(a.time, i);
    return { x, a: at, b: found?.speed === null ? null : found, aside: apart(at, found) };
  });
}

/** @param {Course} a @param {Course} b @returns {Row[]} */
function byWay(a, b) {
  const hasPlaces = a.way.lat.some((one) => one !== null) && b.way.lat.some((one) => one !== null);
  let last = 0;
  return a.way.t.map((_, i) => {
    const at = pointOf(a.way, i);
    const x = i * a.step_m;
    let j = Math.round(x / b.step_m);
    let aside = null;
    if (hasPlaces) {
      const near = at.lat === null ? null : nearest(at, b.way, last);
      if (near === null || near.aside > NEAR_M || isEdge(near, b)) return { x, a: at, b: null, aside: null };
      ({ j, aside } = near);
      last = j;
    }
    const found = j < b.way.t.length ? pointOf(b.way, j) : null;
    return { x, a: at, b: found?.speed === null ? null : found, aside };
  });
}

/** The nearest of the next points; both ways are driven forward. @param {Point} at @param {Points} points @param {number} from */
function nearest(at, points, from) {
  let best = null;
  for (let j = Math.max(0, from - 2); j < Math.min(points.t.length, from + AHEAD); j += 1) {
    const aside = apart(at, pointOf(points, j));
    if (aside !== null && (best === null || aside < best.aside)) best = { j, aside };
  }
  return best;
}

/** Whether the nearest point is only the last one before a gap, or the first after it. @param {{j: number, aside: number}} near @param {Course} b */
function isEdge({ j, aside }, b) {
  const isUnknown = (/** @type {number} */ i) => i >= 0 && i < b.way.t.length && b.way.lat[i] === null;
  return aside > 2 * b.step_m && (isUnknown(j - 1) || isUnknown(j + 1));
}

/** @param {Points} points @param {number} i @returns {Point} */
function pointOf(points, i) {
  return { t: points.t[i] ?? 0, m: points.m[i] ?? null, speed: points.speed[i] ?? null, steering: points.steering[i] ?? null, follow: points.follow?.[i] ?? null, gps: points.gps?.[i] ?? null, lat: points.lat[i] ?? null, lon: points.lon[i] ?? null };
}

/** Metres between two places that are near each other. @param {Point} one @param {Point | null} other */
export function apart(one, other) {
  if (!other || one.lat === null || one.lon === null || other.lat === null || other.lon === null) return null;
  const rad = Math.PI / 180;
  return EARTH_M * rad * Math.hypot(one.lat - other.lat, (one.lon - other.lon) * Math.cos(one.lat * rad));
}

/** B minus A of one number; null where one is not known. @param {Row} row @param {'speed' | 'steering'} what */
export function difference({ a, b }, what) {
  const [one, other] = [a[what], b?.[what] ?? null];
  return one === null || other === null ? null : (what === 'speed' ? Math.abs(other) - Math.abs(one) : other - one);
}

/** Where they differ most: at most two of speed, one aside, one of steering. @param {Row[]} rows @returns {Difference[]} */
export function differences(rows) {
  const speed = peaks(rows, (row) => difference(row, 'speed'), 2, 0.5).map(({ x, value }) => ({ x, text: value < 0 ? 'B slower' : 'B faster', value: `${fixed(Math.abs(value))} m/s` }));
  const aside = peaks(rows, (row) => row.aside, 1, 1).map(({ x, value }) => ({ x, text: 'B aside', value: `${fixed(value)} m` }));
  const steering = peaks(rows, (row) => difference(row, 'steering'), 1, 3).map(({ x, value }) => ({ x, text: value < 0 ? 'B steers further left' : 'B steers further right', value: `${Math.abs(value).toFixed(0)} %` }));
  return [...speed, ...aside, ...steering];
}

/** The largest values, apart by a tenth of all. @param {Row[]} rows @param {(row: Row) => number | null} of @param {number} most @param {number} least */
function peaks(rows, of, most, least) {
  const span = (rows.at(-1)?.x ?? 0) / 10;
  const sorted = rows.flatMap((row) => {
    const value = of(row);
    return value === null || Math.abs(value) < least ? [] : [{ x: row.x, value }];
  }).sort((one, other) => Math.abs(other.value) - Math.abs(one.value));
  /** @type {{x: number, value: number}[]} */
  const found = [];
  for (const one of sorted) {
    if (found.length >= most) break;
    if (found.every(({ x }) => Math.abs(x - one.x) > span)) found.push(one);
  }
  return found;
}

/** Where an event of B is on A's axis; null: not on it. @param {Row[]} rows @param {number} t */
export function placeOfB(rows, t) {
  let best = null;
  for (const { x, b } of rows) if (b && (best === null || Math.abs(b.t - t) < best.off)) best = { x, off: Math.abs(b.t - t) };
  return best !== null && best.off < 5 ? best.x : null;
}
