// The drawings of the logbook: a rate week by week with its median, the distance by mode, faults by component.

import { fixed } from '../core/format.js';
import { svg } from '../core/dom.js';

/**
 * @typedef {import('../core/protocol-types.js').LogbookWeek} Week
 * @typedef {{width: number, height: number, left: number, right: number, top: number, bottom: number}} Frame
 */

const MONTHS = ['Jan', 'Feb', 'Mar', 'Apr', 'May', 'Jun', 'Jul', 'Aug', 'Sep', 'Oct', 'Nov', 'Dec'];
const LEAST_PX = 44; // between two names of months

/** A round number of steps up to at least `highest`. @param {number} highest @param {number} [most] */
export function ticksTo(highest, most = 4) {
  const top = Math.max(highest, 1e-6);
  const size = 10 ** Math.floor(Math.log10(top / most));
  const step = [1, 2, 5, 10].map((factor) => factor * size).find((one) => top / one <= most + 1e-9) ?? 10 * size;
  return Array.from({ length: Math.ceil(top / step - 1e-9) + 1 }, (_, i) => Number((i * step).toPrecision(6)));
}

/** Dots: weeks; line: their median; its end stands at the right. @param {Week[]} weeks @param {'interventions' | 'alarms'} what @param {number} width */
export function ratePlot(weeks, what, width) {
  const frame = frameOf(width, 190, 62);
  const median = /** @type {'interventions_median' | 'alarms_median'} */ (`${what}_median`);
  const values = weeks.flatMap((week) => [week[what] ?? 0, week[median] ?? 0]);
  const marks = ticksTo(Math.max(...values, 1));
  const y = scaleOf(0, marks.at(-1) ?? 1, frame.bottom, frame.top);
  const x = placesOf(weeks, frame);
  const parts = [...rows(marks, y, frame), ...empty(weeks, x, frame), ...months(weeks, x, frame)];
  for (const line of lines(weeks, median)) parts.push(svg('path', { class: 'lb-line', d: `M${line.map((i) => `${x(i).toFixed(1)} ${y(weeks[i]?.[median] ?? 0).toFixed(1)}`).join('L')}` }));
  weeks.forEach((week, i) => {
    const value = week[what];
    if (value !== null) parts.push(svg('circle', { class: 'lb-dot', cx: x(i).toFixed(1), cy: y(value).toFixed(1), r: 3.5 }));
  });
  const last = weeks.findLast((week) => week[median] !== null);
  if (last) parts.push(svg('text', { class: 'lb-end', x: frame.right + 8, y: y(last[median] ?? 0) + 7 }, numberOf(last[median] ?? 0)));
  return drawn(frame, parts, `${what} per 100 ${what === 'interventions' ? 'autonomous ' : ''}km, week by week${last ? `; the median of the last weeks is ${numberOf(last[median] ?? 0)}` : ''}`);
}

/** Solid autonomous, hollow manual, hatched not known. @param {Week[]} weeks @param {number} width */
export function modesPlot(weeks, width) {
  const frame = frameOf(width, 190, 62);
  const totals = weeks.map(({ modes_m: { autonomous = 0, manual = 0, unknown = 0 } }) => (autonomous + manual + unknown) / 1000);
  const marks = ticksTo(Math.max(...totals, 0.1));
  const y = scaleOf(0, marks.at(-1) ?? 1, frame.bottom, frame.top);
  const x = placesOf(weeks, frame);
  const wide = Math.max(2, Math.min(26, (frame.right - frame.left) / Math.max(weeks.length, 1) * 0.7));
  const parts = [...rows(marks, y, frame), ...empty(weeks, x, frame), ...months(weeks, x, frame)];
  weeks.forEach((week, i) => {
    let from = 0;
    for (const mode of ['autonomous', 'manual', 'unknown']) {
      const km = (week.modes_m[mode] ?? 0) / 1000;
      if (km > 0) parts.push(bar(mode, x(i) - wide / 2, y(from + km), wide, y(from) - y(from + km)));
      from += km;
    }
  });
  return drawn(frame, parts, 'Distance by mode, week by week; solid autonomous, hollow manual, hatched not known');
}

/** @param {number} value */
export const numberOf = (value) => fixed(value, value >= 100 ? 0 : 1);

/** @param {string} mode @param {number} x @param {number} y @param {number} width @param {number} height */
function bar(mode, x, y, width, height) {
  const box = svg('rect', { class: `lb-bar ${mode}`, x: x.toFixed(1), y: y.toFixed(1), width: width.toFixed(1), height: Math.max(height, 0.5).toFixed(1) });
  if (mode !== 'unknown') return box;
  return svg('g', {}, box, hatch(x, y, width, height));
}

/** @param {number} left @param {number} top @param {number} width @param {number} height */
export function hatch(left, top, width, height) {
  let d = '';
  for (let at = -height; at < width && d.length < 20_000; at += 7) {
    const [from, to] = [Math.max(0, at), Math.min(width, at + height)];
    d += `M${(left + from).toFixed(1)} ${(top + height - (from - at)).toFixed(1)}L${(left + to).toFixed(1)} ${(top + height - (to - at)).toFixed(1)}`;
  }
  return svg('path', { class: 'lb-hatch', d });
}

/** @param {number} width @param {number} height @param {number} end @returns {Frame} */
function frameOf(width, height, end) {
  return { width, height, left: 40, right: Math.max(120, width - end), top: 12, bottom: height - 26 };
}

/** @param {number} low @param {number} high @param {number} from @param {number} to */
const scaleOf = (low, high, from, to) => (/** @type {number} */ value) => from + ((value - low) / (high - low || 1)) * (to - from);

/** @param {Week[]} weeks @param {Frame} frame */
function placesOf(weeks, frame) {
  const step = (frame.right - frame.left) / Math.max(weeks.length, 1);
  return (/** @type {number} */ i) => frame.left + (i + 0.5) * step;
}

/** @param {number[]} marks @param {(value: number) => number} y @param {Frame} frame */
function rows(marks, y, frame) {
  return marks.flatMap((mark, i) => [
    svg('path', { class: i ? 'lb-grid' : 'lb-axis', d: `M${frame.left} ${y(mark).toFixed(1)}H${frame.right}` }),
    svg('text', { class: 'lb-num', x: frame.left - 7, y: y(mark) + 4.5, 'text-anchor': 'end' }, String(mark)),
  ]);
}

/** Weeks without a drive: each run of them is one area. @param {Week[]} weeks @param {(i: number) => number} x @param {Frame} frame */
function empty(weeks, x, frame) {
  const half = (x(1) - x(0)) / 2;
  const found = [];
  for (let i = 0; i < weeks.length; i += 1) {
    if (weeks[i]?.drives) continue;
    const first = i;
    while (i + 1 < weeks.length && !weeks[i + 1]?.drives) i += 1;
    found.push(hatch(x(first) - half, frame.top, x(i) - x(first) + 2 * half, frame.bottom - frame.top));
  }
  return found;
}

/** @param {Week[]} weeks @param {(i: number) => number} x @param {Frame} frame */
function months(weeks, x, frame) {
  const found = [];
  let last = '';
  let last_px = -Infinity;
  for (const [i, week] of weeks.entries()) {
    const month = MONTHS[new Date(week.from_ms).getUTCMonth()] ?? '';
    if (month === last) continue;
    last = month;
    if (x(i) - last_px < LEAST_PX) continue;
    last_px = x(i);
    found.push(svg('path', { class: 'lb-axis', d: `M${x(i).toFixed(1)} ${frame.bottom}v5` }), svg('text', { class: 'lb-num', x: x(i).toFixed(1), y: frame.bottom + 19, 'text-anchor': 'middle' }, month));
  }
  return found;
}

/** The runs of weeks that have a median. @param {Week[]} weeks @param {'interventions_median' | 'alarms_median'} median */
function lines(weeks, median) {
  /** @type {number[][]} */
  const runs = [];
  let isOpen = false;
  weeks.forEach((week, i) => {
    if (!week.drives) isOpen = false;
    if (week[median] === null) return;
    if (!isOpen) runs.push([]);
    isOpen = true;
    runs.at(-1)?.push(i);
  });
  return runs.map((run) => (run.length === 1 ? [run[0] ?? 0, run[0] ?? 0] : run));
}

/** @param {Frame} frame @param {SVGElement[]} parts @param {string} label */
function drawn(frame, parts, label) {
  return svg('svg', { viewBox: `0 0 ${frame.width} ${frame.height}`, width: frame.width, height: frame.height, role: 'img', 'aria-label': label }, ...parts);
}
