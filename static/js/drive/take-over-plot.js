// The 16 s about an intervention: speed as a line, brake dashed, the change as a wheel at its moment.

import { html, setAttribute, svg } from '../core/dom.js';
import { fixed } from '../core/format.js';
import { shownIn } from '../core/units.js';

/** @typedef {import('../core/protocol-types.js').DriveSample} Sample */

export const BEFORE_S = 10;
export const AFTER_S = 6;
const [WIDTH, HEIGHT] = [380, 134];
const [LEFT, RIGHT, TOP, BASE] = [34, 328, 22, 108];
/** A gap in the samples that breaks the line [s]. */
const BREAK_S = 1.2;

/** @param {number} at_s */
export const xOf = (at_s) => LEFT + ((at_s + BEFORE_S) / (BEFORE_S + AFTER_S)) * (RIGHT - LEFT);

/** The value at the top of the axis: a round one above all. @param {number} most */
export function topOf(most) {
  const step = [1, 2, 5, 10, 20, 50].find((one) => most / one <= 3) ?? 100;
  return Math.max(step, Math.ceil(most / step) * step);
}

/**
 * @param {readonly Sample[]} samples
 * @param {(sample: Sample) => number | null} valueOf
 * @param {number} top
 */
export function pathOf(samples, valueOf, top) {
  let last_s = -Infinity;
  return samples.flatMap((sample) => {
    const value = valueOf(sample);
    if (value === null || sample.at_s < -BEFORE_S || sample.at_s > AFTER_S) return [];
    const begins = sample.at_s - last_s > BREAK_S;
    last_s = sample.at_s;
    return [`${begins ? 'M' : 'L'}${xOf(sample.at_s).toFixed(1)} ${(BASE - (Math.min(Math.max(value, 0), top) / top) * (BASE - TOP)).toFixed(1)}`];
  }).join('');
}

export class TakeOverPlot {
  #grid = svg('g');
  #after = svg('path', { class: 'after', d: `M${xOf(0)} ${TOP}H${RIGHT}V${BASE}H${xOf(0)}z` });
  #speed = svg('path', { class: 'l' });
  #brake = svg('path', { class: 'b' });
  #words = svg('g');
  element = html('div', { class: 'take-over-plot' }, /** @type {any} */ (svg('svg', { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img', 'aria-label': 'Speed and brake from 10 s before to 6 s after' },
    this.#after, this.#grid, this.#brake, this.#speed, svg('path', { class: 'axis', d: `M${LEFT} ${BASE}H${RIGHT} M${xOf(0)} 14V${BASE}` }),
    svg('g', { class: 'wheel', transform: `translate(${xOf(0).toFixed(1)} 10)` }, svg('circle', { r: 7 }), svg('path', { d: 'M-7 0h14M0 0v7' })), this.#words)));

  /** @param {readonly Sample[]} samples @param {boolean} isToManual */
  draw(samples, isToManual) {
    const speeds = samples.flatMap(({ speed_mps }) => (speed_mps === null ? [] : [shownIn(Math.abs(speed_mps), 'm/s').value]));
    const top = topOf(Math.max(...speeds, 1));
    const { unit } = shownIn(0, 'm/s');
    setAttribute(this.#speed, 'd', pathOf(samples, ({ speed_mps }) => shownIn(speed_mps === null ? null : Math.abs(speed_mps), 'm/s').value, top));
    setAttribute(this.#brake, 'd', pathOf(samples, ({ brake_percent }) => brake_percent, 100));
    const y = (/** @type {number} */ value) => BASE - (value / top) * (BASE - TOP);
    this.#grid.replaceChildren(
      ...[0, top / 2, top].flatMap((value) => [svg('path', { class: 'grid', d: `M${LEFT} ${y(value)}H${RIGHT}` }), svg('text', { x: LEFT - 6, y: y(value) + 4, 'text-anchor': 'end' }, fixed(value, Number.isInteger(value) ? 0 : 1))]),
      ...[-10, -5, 0, 5].flatMap((at_s) => [svg('path', { class: 'axis', d: `M${xOf(at_s)} ${BASE}v5` }), svg('text', { x: xOf(at_s), y: BASE + 20, 'text-anchor': 'middle' }, at_s === 5 ? '+5 s' : String(at_s).replace('-', '−'))]),
    );
    const last = samples.filter(({ speed_mps }) => speed_mps !== null).at(-1);
    const most = samples.reduce((/** @type {Sample | null} */ found, sample) => ((sample.brake_percent ?? 0) > (found?.brake_percent ?? 2) ? sample : found), null);
    const speedAt = last ? y(shownIn(Math.abs(last.speed_mps ?? 0), 'm/s').value) : BASE;
    this.#words.replaceChildren(
      svg('text', { class: 'w', x: 0, y: 12 }, unit),
      svg('text', { class: 'w s', x: xOf(0) - 12, y: 15, 'text-anchor': 'end' }, 'autonomous'),
      svg('text', { class: 'w', x: xOf(0) + 12, y: 15 }, isToManual ? 'manual' : ''),
      svg('text', { class: 'w', x: Math.min(RIGHT, last ? xOf(Math.min(last.at_s, AFTER_S)) : RIGHT) + 6, y: Math.min(BASE - 2, speedAt + 4) }, last ? 'speed' : ''),
      ...(most ? [svg('text', { class: 'w s', x: Math.min(xOf(Math.min(most.at_s, AFTER_S)) + 6, RIGHT - 76), y: Math.max(TOP + 14, BASE - ((most.brake_percent ?? 0) / 100) * (BASE - TOP) - 6) }, `brake ${Math.round(most.brake_percent ?? 0)} %`)] : []),
    );
  }
}
