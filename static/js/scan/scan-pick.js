// Which return the operator means, and where it is in the next scan: pure functions.

import { bearingOf, rangeOf } from './scan-frame.js';

/** Half a thumb's width: a touch means a return no farther from it [px]. */
export const THUMB_PX = 28;
/** From scan to scan a return that was marked may move so far [m]: 11 m/s at 10 scans a second. */
const FOLLOWED_M = 1.1;
/** One step of the arrow keys: the next return at least so far to the side [rad]. */
const STEP_RAD = (2 * Math.PI) / 180;

/**
 * @typedef {import('./scan-frame.js').Scan} Scan
 * @typedef {{beam: number, range_m: number, bearing_rad: number, x_m: number, y_m: number}} Return
 */

/**
 * The return of a beam, or null where it measured nothing.
 * @param {Scan} scan
 * @param {number} beam
 * @returns {Return | null}
 */
export function returnOf(scan, beam) {
  const range_m = rangeOf(scan, beam);
  if (range_m === null) return null;
  const bearing_rad = bearingOf(scan, beam);
  const { x_m = 0, y_m = 0 } = scan;
  return { beam, range_m, bearing_rad, x_m: range_m * Math.cos(bearing_rad) + x_m, y_m: range_m * Math.sin(bearing_rad) + y_m };
}

/**
 * The return nearest to a place, no farther from it than `within_m`.
 * @param {Scan} scan
 * @param {number} x_m
 * @param {number} y_m
 * @param {number} within_m
 */
export function nearestTo(scan, x_m, y_m, within_m) {
  /** @type {Return | null} */
  let best = null;
  let least_m = within_m;
  for (let beam = 0; beam < scan.codes.length; beam += 1) {
    const one = returnOf(scan, beam);
    if (!one) continue;
    const away_m = Math.hypot(one.x_m - x_m, one.y_m - y_m);
    if (away_m > least_m) continue;
    best = one;
    least_m = away_m;
  }
  return best;
}

/**
 * Where a marked return is in a newer scan; null: nothing near it any more.
 * @param {Scan} scan
 * @param {Return} marked
 */
export function follow(scan, marked) {
  return nearestTo(scan, marked.x_m, marked.y_m, FOLLOWED_M);
}

/**
 * The return nearest to the laser and in the picture, where the arrow keys begin.
 * @param {Scan} scan
 * @param {number} reach_m
 */
export function nearestShown(scan, reach_m) {
  /** @type {Return | null} */
  let best = null;
  for (let beam = 0; beam < scan.codes.length; beam += 1) {
    const one = returnOf(scan, beam);
    if (one && isShown(one, reach_m) && (best === null || one.range_m < best.range_m)) best = one;
  }
  return best;
}

/**
 * The next return to the left (+1) or right (−1) of a marked one; that one where there is none farther.
 * @param {Scan} scan
 * @param {Return} marked
 * @param {1 | -1} side
 * @param {number} reach_m
 */
export function beside(scan, marked, side, reach_m) {
  let best = marked;
  let least_rad = Infinity;
  for (let beam = 0; beam < scan.codes.length; beam += 1) {
    const aside_rad = side * (bearingOf(scan, beam) - marked.bearing_rad);
    if (aside_rad < STEP_RAD || aside_rad >= least_rad) continue;
    const one = returnOf(scan, beam);
    if (!one || !isShown(one, reach_m)) continue;
    best = one;
    least_rad = aside_rad;
  }
  return best;
}

/** @param {Return} one @param {number} reach_m */
function isShown(one, reach_m) {
  return one.x_m >= 0 && one.range_m <= reach_m;
}
