// The return the operator marked: followed from scan to scan, until it is tapped away, or is gone, or the data goes.

import { beside, follow, nearestShown, nearestTo } from './scan-pick.js';
import { bearing, fixed } from '../core/format.js';

/** A marked return that no scan shows any more is let go after this time [ms]. */
const KEPT_MS = 1000;

/**
 * @typedef {import('./scan-frame.js').Scan} Scan
 * @typedef {import('./scan-pick.js').Return} Return
 */

export class ScanMark {
  /** @type {Return | null} */
  at = null;
  /** Is it in the newest scan? */
  isSeen = false;
  /** When the scan came that showed it last [ms, monotonic]. */
  seen_ms = -Infinity;

  /**
   * The return nearest to a place, or none where there is none within reach, or where the marked one is touched again.
   * @param {Scan} scan
   * @param {number} x_m
   * @param {number} y_m
   * @param {number} within_m
   * @param {number} at_ms when the scan came
   */
  touch(scan, x_m, y_m, within_m, at_ms) {
    const found = nearestTo(scan, x_m, y_m, within_m);
    const isSame = found !== null && this.at !== null && Math.hypot(found.x_m - this.at.x_m, found.y_m - this.at.y_m) < within_m / 2;
    this.#set(isSame ? null : found, at_ms);
  }

  /**
   * The next return to the left (+1) or right (−1); the nearest where none is marked.
   * @param {Scan} scan
   * @param {1 | -1 | 0} side 0: the nearest
   * @param {number} reach_m
   * @param {number} at_ms
   */
  step(scan, side, reach_m, at_ms) {
    this.#set(this.at && side !== 0 ? beside(scan, this.at, side, reach_m) : nearestShown(scan, reach_m), at_ms);
  }

  clear() {
    this.#set(null, -Infinity);
  }

  /**
   * A newer scan came.
   * @param {Scan} scan
   * @param {number} at_ms
   * @returns {boolean} false when the marked return has just been let go
   */
  hear(scan, at_ms) {
    if (!this.at) return true;
    const found = follow(scan, this.at);
    if (found) {
      this.#set(found, at_ms);
      return true;
    }
    this.isSeen = false;
    if (at_ms - this.seen_ms <= KEPT_MS) return true;
    this.clear();
    return false;
  }

  /** "8.3 m, 14° left"; empty where nothing is marked. */
  get text() {
    if (!this.at) return '';
    const side = bearing(this.at.bearing_rad);
    return `${fixed(this.at.range_m)} m, ${side?.side === 'ahead' ? 'straight ahead' : `${side?.degrees} ${side?.side}`}`;
  }

  /** @param {Return | null} one @param {number} at_ms */
  #set(one, at_ms) {
    this.at = one;
    this.isSeen = one !== null;
    this.seen_ms = at_ms;
  }
}
