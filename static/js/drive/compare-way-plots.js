// The drawings of two drives beside each other: one axis, one cursor, A solid and B dotted.

import { difference, placeOfB } from './compare-way-model.js';
import { hatch, ticksTo } from './logbook-plots.js';
import { svg } from '../core/dom.js';

/**
 * @typedef {import('./compare-way-model.js').Row} Row
 * @typedef {import('./compare-way-model.js').By} By
 * @typedef {import('../core/protocol-types.js').CourseEvent} CourseEvent
 * @typedef {{width: number, height: number, left: number, right: number, top: number, bottom: number}} Frame
 */

const LEFT = 44;

/** @param {number} width @param {number} height @returns {Frame} */
const frameOf = (width, height) => ({ width, height, left: LEFT, right: width - 8, top: 14, bottom: height - 8 });

/** Pixels of a place on the axis, and back. @param {Row[]} rows @param {number} width */
export function axisOf(rows, width) {
  const end = rows.at(-1)?.x || 1;
  const [from, to] = [LEFT, width - 8];
  return { px: (/** @type {number} */ x) => from + (x / end) * (to - from), x: (/** @type {number} */ px) => Math.min(end, Math.max(0, ((px - from) / (to - from)) * end)) };
}

/** Speed of both, with the limit. @param {Row[]} rows @param {number} width @param {number | null} limit */
export function speedPlot(rows, width, limit) {
  const frame = frameOf(width, 190);
  const marks = ticksTo(Math.max(limit ?? 0, ...rows.flatMap(({ a, b }) => [Math.abs(a.speed ?? 0), Math.abs(b?.speed ?? 0)])) * 1.04, 3);
  const y = (/** @type {number} */ value) => frame.bottom - (value / (marks.at(-1) ?? 1)) * (frame.bottom - frame.top);
  const { px } = axisOf(rows, width);
  return plot(frame, [
    ...rowsOf(marks, y, frame), ...noData(rows, px, frame),
    ...(limit === null ? [] : [svg('path', { class: 'cw-limit', d: `M${LEFT} ${y(limit).toFixed(1)}H${frame.right}` }), svg('text', { class: 'cw-limit-text', x: frame.right, y: y(limit) - 5, 'text-anchor': 'end' }, `limit ${limit.toFixed(1)}`)]),
    line('cw-b', rows, ({ b }) => (b?.speed === null || !b ? null : Math.abs(b.speed ?? 0)), px, y), line('cw-a', rows, ({ a }) => (a.speed === null ? null : Math.abs(a.speed)), px, y),
  ], 'Speed, A solid and B dotted');
}

/** B − A; null: known nowhere. @param {Row[]} rows @param {number} width @param {'speed' | 'steering'} what */
export function differencePlot(rows, width, what) {
  const known = rows.map((row) => difference(row, what)).filter((value) => value !== null);
  if (!known.length) return null;
  const frame = frameOf(width, 110);
  const most = Math.max(1, ...known.map(Math.abs));
  const top = ticksTo(most, 1).at(-1) ?? 1;
  const y = scale(top, frame);
  const { px } = axisOf(rows, width);
  return plot(frame, [...rowsOf([-top, 0, top], y, frame), ...noData(rows, px, frame), area(rows, (row) => difference(row, what), px, y), line('cw-a', rows, (row) => difference(row, what), px, y)], 'B minus A');
}

/** One number of both; null: neither knows it. @param {Row[]} rows @param {number} width @param {'steering' | 'follow' | 'gps'} what @param {string} name @param {number} least at the end of the axis */
export function bothPlot(rows, width, what, name, least) {
  const values = rows.flatMap(({ a, b }) => [a[what], b?.[what] ?? null]).filter((value) => value !== null);
  if (!values.length) return null;
  const frame = frameOf(width, 130);
  const top = ticksTo(Math.max(least, ...values.map(Math.abs)), 1).at(-1) ?? 1;
  const isSigned = what !== 'gps';
  const y = isSigned ? scale(top, frame) : (/** @type {number} */ value) => frame.bottom - (value / top) * (frame.bottom - frame.top);
  const { px } = axisOf(rows, width);
  return plot(frame, [...rowsOf(isSigned ? [-top, 0, top] : [0, top], y, frame), ...noData(rows, px, frame), line('cw-b', rows, ({ b }) => b?.[what] ?? null, px, y), line('cw-a', rows, ({ a }) => a[what], px, y)], `${name}, A solid and B dotted`);
}

/** Alarms, marks and interventions of both, and the axis. @param {Row[]} rows @param {number} width @param {By} by @param {CourseEvent[]} ofA @param {CourseEvent[]} ofB */
export function eventsPlot(rows, width, by, ofA, ofB) {
  const frame = { ...frameOf(width, 112), bottom: 70 };
  const { px } = axisOf(rows, width);
  const parts = [26, 54].flatMap((y, i) => [svg('text', { class: 'cw-name', x: 12, y: y + 6 }, i ? 'B' : 'A'), svg('path', { class: 'lb-grid', d: `M${LEFT} ${y}H${frame.right}` })]);
  for (const { t, m, kind } of ofA) {
    const x = by === 'time' ? t : m;
    if (x !== null) parts.push(sign(kind, px(x), 26));
  }
  for (const { t, kind } of ofB) {
    const x = placeOfB(rows, t);
    if (x !== null) parts.push(sign(kind, px(x), 54));
  }
  const end = rows.at(-1)?.x ?? 1;
  const unit = by === 'time' ? 's' : end > 2000 ? 'km' : 'm';
  const size = unit === 'km' ? 1000 : 1;
  for (const mark of ticksTo(end / size, 5).filter((one) => one * size <= end)) {
    parts.push(svg('path', { class: 'lb-axis', d: `M${px(mark * size).toFixed(1)} 78v5` }), svg('text', { class: 'lb-num', x: px(mark * size).toFixed(1), y: 98, 'text-anchor': mark ? 'middle' : 'start' }, mark ? String(mark) : `0 ${unit}`));
  }
  parts.push(svg('path', { class: 'lb-axis', d: `M${LEFT} 78H${frame.right}` }));
  return plot(frame, parts, 'Alarms, marks and interventions of A and B');
}

/** Both ways, north up; null: one has no place. @param {Row[]} rows @param {number} width */
export function waysMap(rows, width) {
  const known = rows.flatMap(({ a, b }) => [a, ...(b ? [b] : [])]).filter(({ lat, lon }) => lat !== null && lon !== null);
  const first = known[0];
  if (!first || known.length < 4) return null;
  const lat0 = first.lat ?? 0;
  const east = (/** @type {{lon: number | null}} */ one) => ((one.lon ?? 0) - (first.lon ?? 0)) * Math.cos(lat0 * Math.PI / 180);
  const north = (/** @type {{lat: number | null}} */ one) => (one.lat ?? 0) - lat0;
  const [e0, e1, n0, n1] = [Math.min(...known.map(east)), Math.max(...known.map(east)), Math.min(...known.map(north)), Math.max(...known.map(north))];
  const height = 260;
  const size = Math.min((width - 32) / Math.max(e1 - e0, 2e-4), (height - 32) / Math.max(n1 - n0, 2e-4));
  const at = (/** @type {import('./compare-way-model.js').Point} */ one) => [width / 2 + (east(one) - (e0 + e1) / 2) * size, height / 2 - (north(one) - (n0 + n1) / 2) * size];
  const path = (/** @type {(import('./compare-way-model.js').Point | null)[]} */ points) => pieces(points.map((one) => (one && one.lat !== null ? /** @type {[number, number]} */ (at(one)) : null)));
  const drawing = svg('svg', { viewBox: `0 0 ${width} ${height}`, width, height, role: 'img', 'aria-label': 'Both ways, north up; A solid, B dotted' },
    svg('path', { class: 'cw-b', d: path(rows.map(({ b }) => b)) }), svg('path', { class: 'cw-a', d: path(rows.map(({ a }) => a)) }), svg('circle', { class: 'cw-here', r: 7, cx: -20, cy: -20 }));
  return { drawing, at };
}

/** @param {number} top @param {Frame} frame */
const scale = (top, frame) => (/** @type {number} */ value) => (frame.top + frame.bottom) / 2 - (value / top) * (frame.bottom - frame.top) / 2;

/** @param {number[]} marks @param {(value: number) => number} y @param {Frame} frame */
function rowsOf(marks, y, frame) {
  return marks.flatMap((mark) => [svg('path', { class: mark ? 'lb-grid' : 'lb-axis', d: `M${frame.left} ${y(mark).toFixed(1)}H${frame.right}` }),
    svg('text', { class: 'lb-num', x: frame.left - 7, y: y(mark) + 4.5, 'text-anchor': 'end' }, `${mark < 0 ? '−' : ''}${Math.abs(mark)}`)]);
}

/** @param {string} kind @param {Row[]} rows @param {(row: Row) => number | null} of @param {(x: number) => number} px @param {(value: number) => number} y */
function line(kind, rows, of, px, y) {
  return svg('path', { class: kind, d: pieces(rows.map((row) => {
    const value = of(row);
    return value === null ? null : [px(row.x), y(value)];
  })) });
}

/** The area to 0. @param {Row[]} rows @param {(row: Row) => number | null} of @param {(x: number) => number} px @param {(value: number) => number} y */
function area(rows, of, px, y) {
  let d = '';
  /** @type {string[]} */
  let run = [];
  let [from, to] = [0, 0];
  const close = () => {
    if (run.length > 1) d += `M${from.toFixed(1)} ${y(0).toFixed(1)}L${run.join('L')}L${to.toFixed(1)} ${y(0).toFixed(1)}Z`;
    run = [];
  };
  for (const row of rows) {
    const value = of(row);
    if (value === null) close();
    else {
      if (!run.length) from = px(row.x);
      to = px(row.x);
      run.push(`${to.toFixed(1)} ${y(value).toFixed(1)}`);
    }
  }
  close();
  return svg('path', { class: 'cw-area', d });
}

/** Lines that no gap is bridged by. @param {([number, number] | null)[]} points */
function pieces(points) {
  let d = '';
  let isOpen = false;
  for (const point of points) {
    if (point) d += `${isOpen ? 'L' : 'M'}${point[0].toFixed(1)} ${point[1].toFixed(1)}`;
    isOpen = point !== null;
  }
  return d || 'M0 0';
}

/** Where B has no data. @param {Row[]} rows @param {(x: number) => number} px @param {Frame} frame */
function noData(rows, px, frame) {
  const found = [];
  for (let i = 0; i < rows.length; i += 1) {
    if (rows[i]?.b) continue;
    const first = i;
    while (i + 1 < rows.length && !rows[i + 1]?.b) i += 1;
    const [left, right] = [px(rows[first]?.x ?? 0), px(rows[i]?.x ?? 0)];
    if (right > left) found.push(hatch(left, frame.top, right - left, frame.bottom - frame.top));
  }
  return found;
}

/** @param {string} kind @param {number} x @param {number} y */
function sign(kind, x, y) {
  const at = `translate(${x.toFixed(1)} ${y})`;
  if (kind === 'critical') return svg('path', { class: 'cw-crit', transform: at, d: 'M0-7l7 7-7 7-7-7z' });
  if (kind === 'warning' || kind === 'advisory') return svg('path', { class: 'cw-warn', transform: at, d: 'M0-8l8 14h-16z' });
  if (kind === 'mark') return svg('path', { class: 'cw-flag', transform: at, d: 'M0 8v-18h13l-4 5 4 5h-13' });
  return svg('g', { class: 'cw-wheel', transform: at }, svg('circle', { r: 8 }), svg('path', { d: 'M-8-1h16M0-1v9' }));
}

/** @param {Frame} frame @param {SVGElement[]} parts @param {string} label */
function plot(frame, parts, label) {
  return svg('svg', { viewBox: `0 0 ${frame.width} ${frame.height}`, width: frame.width, height: frame.height, role: 'img', 'aria-label': label }, ...parts);
}
