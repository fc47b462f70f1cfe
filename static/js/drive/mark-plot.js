// The speed about a mark: 12 s before to 12 s after the tap, the mark as a blue line that the steps move.

import { html, setAttribute, svg } from '../core/dom.js';
import { fixed, signed } from '../core/format.js';
import { shownIn } from '../core/units.js';
import { STEP_S } from '../home/trends-layout.js';

/** So far to each side [s]. */
export const SIDE_S = 12;
const WIDTH = 380;
const HEIGHT = 122;
const [LEFT, RIGHT, TOP, BASE] = [34, 372, 24, 96];
/** A gap in the values that breaks the line [s]. */
const BREAK_S = 0.5;

/**
 * @typedef {{at_s: number, value: number}} Point at_s: from the tap
 * @typedef {{points: Point[], limit: number | null, unit: string, low: number, high: number}} Course in the unit of this phone
 */

/** @param {number} at_s from the tap */
export function xOf(at_s) {
  return LEFT + ((Math.min(Math.max(at_s, -SIDE_S), SIDE_S) + SIDE_S) / (2 * SIDE_S)) * (RIGHT - LEFT);
}

/**
 * The speed about a tap, as far as the page has it.
 * @param {{times_s: number[], highest: (number | null)[]}} course seconds before now
 * @param {number} ago_s the tap was so long before now
 * @param {number | null} limit_mps
 * @returns {Course | null} null: none of it
 */
export function courseOf({ times_s, highest }, ago_s, limit_mps) {
  const { unit } = shownIn(0, 'm/s');
  const points = times_s.flatMap((before_s, i) => {
    const at_s = before_s + ago_s;
    const value = highest[i];
    return value === undefined || value === null || !Number.isFinite(value) || Math.abs(at_s) > SIDE_S + STEP_S ? [] : [{ at_s, value: shownIn(value, 'm/s').value }];
  });
  if (points.length < 2) return null;
  const limit = limit_mps === null ? null : shownIn(limit_mps, 'm/s').value;
  const values = points.map(({ value }) => value);
  const low = Math.min(...values);
  const high = Math.max(...values);
  const isNear = limit !== null && limit < high + 0.6 * Math.max(4, high - low); // a limit far above would press the line flat
  const top = Math.max(high, isNear ? limit : -Infinity);
  const step = [1, 2, 5, 10, 20, 50].find((one) => (top - low) / one <= 3) ?? 100;
  return { points, limit: isNear ? limit : null, unit, low: Math.floor(low / step) * step, high: Math.max(Math.ceil(top / step), Math.floor(low / step) + 1) * step };
}

/** @param {Point[]} points @param {(value: number) => number} y */
export function linePath(points, y) {
  let last_s = -Infinity;
  return points.map(({ at_s, value }) => {
    const begins = at_s - last_s > BREAK_S;
    last_s = at_s;
    return `${begins ? 'M' : 'L'}${xOf(at_s).toFixed(1)} ${y(value).toFixed(1)}`;
  }).join('');
}

export class MarkPlot {
  #line = svg('path', { class: 'l' });
  #limit = svg('path', { class: 'limit' });
  #grid = svg('g');
  #stem = svg('path', { class: 'stem', d: `M0 8V${BASE}` });
  #mark = svg('g', { class: 'mark' }, this.#stem, svg('path', { class: 'flag', d: 'M0 8H16L12 13L16 18H0Z' }));
  #label = svg('text', { y: 19 });
  #picture = svg('svg', { class: 'plot', viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img', 'aria-label': 'Speed about the mark' },
    this.#grid, this.#limit, this.#line, svg('path', { class: 'axis', d: `M${LEFT} ${BASE}H${RIGHT}` }), this.#mark, this.#label);
  #none = html('p', { class: 'sub plot-none', hidden: true }, 'The page does not have the speed of that moment. Its recording does.');
  element = html('div', { class: 'mark-plot' }, /** @type {any} */ (this.#picture), this.#none);

  /** @param {Course | null} course @param {number} shift_s */
  draw(course, shift_s) {
    setAttribute(this.#picture, 'hidden', course === null);
    setAttribute(this.#none, 'hidden', course !== null);
    if (!course) return;
    const { points, limit, unit, low, high } = course;
    const y = (/** @type {number} */ value) => BASE - ((value - low) / (high - low)) * (BASE - TOP);
    setAttribute(this.#line, 'd', linePath(points, y));
    setAttribute(this.#limit, 'd', limit === null ? '' : `M${LEFT} ${y(limit).toFixed(1)}H${RIGHT}`);
    this.#grid.replaceChildren(
      ...[low, (low + high) / 2, high].flatMap((value) => [svg('path', { class: 'grid', d: `M${LEFT} ${y(value)}H${RIGHT}` }), svg('text', { class: 'num', x: LEFT - 6, y: y(value) + 4, 'text-anchor': 'end' }, fixed(value, Number.isInteger(value) ? 0 : 1))]),
      ...[-10, -5, 0, 5, 10].flatMap((at_s) => [svg('path', { class: 'axis', d: `M${xOf(at_s)} ${BASE}v5` }), svg('text', { class: 'num', x: xOf(at_s), y: BASE + 19, 'text-anchor': 'middle' }, at_s === 10 ? '+10 s' : signed(at_s, 0))]),
      svg('text', { class: 'unit', x: 0, y: 12 }, unit),
      ...(limit === null ? [] : [svg('text', { class: 'you', x: LEFT + 6, y: y(limit) - 5 }, `limit ${fixed(limit)}`)]),
    );
    const x = xOf(shift_s);
    setAttribute(this.#mark, 'transform', `translate(${x.toFixed(1)} 0)`);
    const isRight = x > WIDTH - 120;
    setAttribute(this.#label, 'x', (isRight ? x - 6 : x + 20).toFixed(1));
    setAttribute(this.#label, 'text-anchor', isRight ? 'end' : 'start');
    this.#label.textContent = shift_s ? `mark ${signed(shift_s)} s` : 'mark';
  }
}
