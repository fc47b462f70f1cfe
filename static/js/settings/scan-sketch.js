// A small drawing of one laser's newest scan from above, so that an operator sees which laser points ahead.

import { setAttribute, setText, svg } from '../core/dom.js';

/**
 * @typedef {object} SketchedScan a few beams of the newest scan
 * @property {(number | null)[]} ranges_m one for each beam; null: nothing known
 * @property {number} angle_min_rad of the first beam, 0 ahead, to the left positive
 * @property {number} angle_increment_rad
 */

/** Half the side of a drawing [px of its view box]. */
const HALF = 60;
/** How far drawings may reach [m]. */
const REACHES_M = [5, 10, 20, 40];

/**
 * What of an offer can be drawn; null: nothing.
 * @param {unknown} offer of `GET /api/signals`
 * @returns {SketchedScan | null}
 */
export function sketchedOf(offer) {
  const { ranges_m, angle_min_rad, angle_increment_rad } = /** @type {Record<string, unknown>} */ (offer ?? {});
  if (!Array.isArray(ranges_m) || ranges_m.length === 0) return null;
  if (typeof angle_min_rad !== 'number' || typeof angle_increment_rad !== 'number') return null;
  return { ranges_m: ranges_m.map((range) => (typeof range === 'number' && Number.isFinite(range) && range > 0 ? range : null)), angle_min_rad, angle_increment_rad };
}

/**
 * One reach for all drawings that are compared: the smallest that holds two of three returns [m].
 * @param {SketchedScan[]} scans
 */
export function reachOf(scans) {
  const ranges = scans.flatMap(({ ranges_m }) => ranges_m.filter((range) => range !== null)).sort((a, b) => a - b);
  const most = ranges[Math.floor((2 * (ranges.length - 1)) / 3)] ?? 0;
  return REACHES_M.find((reach) => reach >= most) ?? 40;
}

/**
 * The returns as points of the drawing, the car in its middle, ahead upwards.
 * @param {SketchedScan} scan
 * @param {number} reach_m at the edge; farther returns are left out
 * @returns {[number, number][]} x to the right and y downwards [px of the view box]
 */
export function pointsOf({ ranges_m, angle_min_rad, angle_increment_rad }, reach_m) {
  const scale = HALF / reach_m;
  return ranges_m.flatMap((range, i) => {
    if (range === null || range > reach_m) return [];
    const angle = angle_min_rad + i * angle_increment_rad;
    return [/** @type {[number, number]} */ ([-range * Math.sin(angle) * scale, -range * Math.cos(angle) * scale])];
  });
}

/** A drawing that is filled again with each newer scan. */
export class ScanSketch {
  constructor() {
    this.points = svg('path', { class: 'points' });
    this.ring = svg('text', { class: 'num', x: 0, y: HALF - 7, 'text-anchor': 'middle' });
    this.element = svg('svg', { class: 'sketch', viewBox: `${-HALF} ${-HALF} ${2 * HALF} ${2 * HALF}`, role: 'img', 'aria-label': 'Its newest scan from above, ahead is up' },
      svg('circle', { class: 'reach', r: HALF - 1 }), svg('path', { class: 'ahead', d: `M0 -9V${-HALF + 8}` }), this.points,
      svg('path', { class: 'car', d: 'M-4.5 8V-4.5L-2.5 -8H2.5L4.5 -4.5V8Z' }), this.ring);
  }

  /** @param {SketchedScan} scan @param {number} reach_m */
  draw(scan, reach_m) {
    setText(this.ring, `${reach_m} m`);
    setAttribute(this.points, 'd', pointsOf(scan, reach_m).map(([x, y]) => `M${x.toFixed(1)} ${y.toFixed(1)}h0`).join(''));
  }
}
