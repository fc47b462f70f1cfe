// What the plot of a scan shows and where: pure functions. x is ahead and y left of the laser, in metres.

import { INVALID, NO_RETURN, NOTHING_IN_RANGE, TOO_CLOSE, rangeOf } from './scan-frame.js';

/** Half the width of the strip in which a return counts as an obstacle [m]; as the obstacle check has it. */
export const CORRIDOR_M = 1.2;
/** A hatched sector narrower than this is not named: the word would not fit [rad]. */
const NAMED_RAD = (6 * Math.PI) / 180;

/** @typedef {import('./scan-frame.js').Scan} Scan */

/**
 * The points to draw: x, y of each usable beam, one after the other [m]. What has no range is not drawn: neither what is
 * too close nor what is beyond.
 * @param {Scan} scan
 * @param {number} reach_m nothing farther is drawn
 * @returns {Float32Array}
 */
export function pointsOf(scan, reach_m) {
  const points = new Float32Array(2 * scan.codes.length);
  let used = 0;
  for (let i = 0; i < scan.codes.length; i += 1) {
    const range = rangeOf(scan, i);
    if (range === null || range > reach_m) continue;
    const angle = scan.angle_min_rad + i * scan.angle_increment_rad;
    points[used] = range * Math.cos(angle);
    points[used + 1] = range * Math.sin(angle);
    used += 2;
  }
  return points.subarray(0, used);
}

/**
 * The nearest return inside the corridor, or null.
 * @param {Scan} scan
 * @returns {{range_m: number, bearing_rad: number} | null}
 */
export function nearestInCorridor(scan) {
  let best = null;
  for (let i = 0; i < scan.codes.length; i += 1) {
    const range_m = rangeOf(scan, i);
    if (range_m === null) continue;
    const bearing_rad = scan.angle_min_rad + i * scan.angle_increment_rad;
    const isInside = Math.abs(range_m * Math.sin(bearing_rad)) < CORRIDOR_M && Math.cos(bearing_rad) > 0;
    if (isInside && (best === null || range_m < best.range_m)) best = { range_m, bearing_rad };
  }
  return best;
}

/**
 * @typedef {{from_rad: number, to_rad: number, code: number, beams: number}} Sector from < to, half a beam wider on each side
 */

/**
 * Neighbouring beams that tell nothing, by what they say. Nothing in range is told by the sensor itself and is not hatched.
 * @param {Scan} scan
 * @returns {Sector[]}
 */
export function sectorsOf(scan) {
  /** @type {Sector[]} */
  const sectors = [];
  const half = Math.abs(scan.angle_increment_rad) / 2;
  /** @type {{code: number, from: number} | null} */
  let open = null;
  const close = (/** @type {number} */ end) => {
    if (!open) return;
    const a = scan.angle_min_rad + open.from * scan.angle_increment_rad;
    const b = scan.angle_min_rad + (end - 1) * scan.angle_increment_rad;
    sectors.push({ from_rad: Math.min(a, b) - half, to_rad: Math.max(a, b) + half, code: open.code, beams: end - open.from });
    open = null;
  };
  for (let i = 0; i < scan.codes.length; i += 1) {
    const code = scan.codes[i] ?? NO_RETURN;
    const isBlind = code === NO_RETURN || code === TOO_CLOSE || code === INVALID;
    if (open && (!isBlind || code !== /** @type {{code: number}} */ (open).code)) close(i);
    if (isBlind && !open) open = { code, from: i };
  }
  close(scan.codes.length);
  return sectors;
}

/** @param {number} code */
export function codeWords(code) {
  if (code === TOO_CLOSE) return 'too close';
  if (code === INVALID) return 'invalid';
  if (code === NOTHING_IN_RANGE) return 'nothing in range';
  return 'no return';
}

/**
 * The sectors worth a word, widest first, at most `count`.
 * @param {Sector[]} sectors
 * @param {number} count
 */
export function namedSectors(sectors, count) {
  return sectors.filter(({ from_rad, to_rad }) => to_rad - from_rad >= NAMED_RAD)
    .sort((a, b) => b.to_rad - b.from_rad - (a.to_rad - a.from_rad)).slice(0, count);
}

/**
 * "164 of 181 beams usable · 17 hatched: no return".
 * @param {Scan} scan
 */
export function beamWords(scan) {
  const counts = new Map();
  for (const code of scan.codes) {
    const kind = code === NO_RETURN || code >= INVALID ? code : -1;
    counts.set(kind, (counts.get(kind) ?? 0) + 1);
  }
  const usable = counts.get(-1) ?? 0;
  const beyond = counts.get(NOTHING_IN_RANGE);
  const parts = beyond ? [`${usable} of ${scan.codes.length} usable`, `${beyond} beyond range`] : [`${usable} of ${scan.codes.length} beams usable`];
  const blind = [NO_RETURN, TOO_CLOSE, INVALID].filter((code) => counts.get(code));
  if (blind.length === 1) parts.push(`${counts.get(blind[0])} hatched: ${codeWords(blind[0] ?? 0)}`);
  else if (blind.length > 1) parts.push(`hatched: ${blind.map((code) => `${counts.get(code)} ${codeWords(code)}`).join(', ')}`);
  return parts.join(' · ');
}

/**
 * Where metres stand on a plot of this size: the car at the foot, ahead is up.
 * @param {number} width
 * @param {number} height
 * @param {number} reach_m
 */
export function plotScale(width, height, reach_m) {
  const cx = width / 2;
  const cy = height - 34;
  const k = (cy - 14) / reach_m;
  return { cx, cy, k, at: (/** @type {number} */ x_m, /** @type {number} */ y_m) => /** @type {[number, number]} */ ([cx - y_m * k, cy - x_m * k]) };
}

/** The four rings of a plot [m]. @param {number} reach_m */
export function ringsOf(reach_m) {
  return [1, 2, 3, 4].map((quarter) => (reach_m * quarter) / 4);
}
