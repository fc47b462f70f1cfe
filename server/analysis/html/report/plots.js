// The curves and the verdicts of the checks, on the time axis of the report.

/* global uPlot */ // stands above all of this in the file

import { INKS, colour, make, must } from './elements.js';
import { clock, indexAt, joined } from './layout.js';
import { GUTTER, SIDE, data, followers, lay, redraws, repaints, timeline, view } from './view.js';

/** @import { Panel } from './layout.js' */

const REASONS = { ok: 'in order', fault: '', unknown: 'not checked' };

export function mountPanel(/** @type {Panel} */ panel) {
  const head = make('div', { class: 'head' }, make('b', {}, panel.unit ? `${panel.title}, ${panel.unit}` : panel.title));
  const values = panel.curves.map((curve) => {
    const value = make('b', { class: 'n' }, '–');
    head.append(make('span', {}, make('i', { 'data-ink': curve.ink }), curve.label, value));
    return value;
  });
  const body = make('div');
  must('plots').append(make('div', { class: 'panel' }, head, body));
  const font = () => `14px "catgraph numerals", system-ui`;
  const axis = { stroke: () => colour('ink2'), font: font(), grid: { stroke: () => colour('line'), width: 1 }, ticks: { show: false } };
  // @ts-ignore: uPlot stands above
  const plot = new uPlot({
    width: timeline.clientWidth,
    height: 150,
    padding: [8, SIDE, 0, 0],
    cursor: { show: false },
    legend: { show: false },
    scales: { x: { time: false, range: () => [view.from, view.to] }, y: { range: rangeOf(panel) } },
    axes: [
      { ...axis, size: 24, gap: 4, values: (/** @type {any} */ _, /** @type {number[]} */ times) => times.map(shortClock) },
      { ...axis, size: GUTTER, gap: 6, splits: undefined, space: 32 },
    ],
    series: [{}, ...panel.curves.map((curve) => ({
      stroke: () => colour(INKS[curve.ink]),
      width: curve.limit ? 2 : curve.ink === 'ink2' ? 1.5 : 2,
      dash: curve.limit ? [6, 5] : undefined,
      points: { show: false },
      spanGaps: false,
      // @ts-ignore
      paths: curve.limit ? uPlot.paths.stepped({ align: 1 }) : undefined,
    }))],
    hooks: { drawClear: [(/** @type {any} */ u) => hatchGaps(u, panel)] },
  }, /** @type {any} */ (joined(panel.curves)), body);
  redraws.push(() => {
    plot.setSize({ width: timeline.clientWidth, height: 150 });
    plot.setScale('x', { min: view.from, max: view.to });
  });
  repaints.push(() => plot.redraw());
  followers.push(() => panel.curves.forEach((curve, index) => {
    const value = curve.v[indexAt(curve.t, view.at)];
    values[index].textContent = value === null || value === undefined ? '–' : value.toFixed(panel.digits).replace('-', '−');
  }));
}

function shortClock(/** @type {number} */ seconds) {
  if (view.to >= 600) return clock(seconds).replace(/\.0$/, '');
  return `${Number(seconds.toFixed(2))}`;
}

/** The range of a panel: the same at every zoom, so that curves can be compared; from zero, with a margin. */
function rangeOf(/** @type {Panel} */ panel) {
  const isTurn = panel.unit === '°';
  let [low, high] = isTurn ? [Infinity, -Infinity] : [0, 0];
  for (const curve of panel.curves) {
    for (const value of curve.v) {
      if (value === null) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  if (low > high) [low, high] = [0, 1];
  const air = Math.max((high - low) * 0.06, panel.digits > 1 ? 0.05 : 0.5);
  return /** @type {[number, number]} */ ([low < 0 || isTurn ? low - air : 0, high + air]);
}

/** Hatches the gaps of the panel's own curve: nothing is known there. */
function hatchGaps(/** @type {any} */ u, /** @type {Panel} */ panel) {
  const curve = panel.curves.findLast((one) => !one.limit);
  if (!curve || curve.t.length === 0) return;
  const gaps = [];
  if (curve.t[0] - data.from > 1) gaps.push([data.from, curve.t[0]]);
  curve.v.forEach((value, index) => {
    if (value === null && index + 1 < curve.t.length && curve.t[index + 1] - curve.t[index] > 0.5) gaps.push([curve.t[index], curve.t[index + 1]]);
  });
  const last = curve.t[curve.t.length - 1];
  if (data.to - last > 1) gaps.push([last, data.to]);
  const { ctx, bbox } = u;
  ctx.save();
  ctx.beginPath();
  for (const [from, to] of gaps) {
    const left = Math.max(bbox.left, u.valToPos(from, 'x', true));
    const right = Math.min(bbox.left + bbox.width, u.valToPos(to, 'x', true));
    if (right > left) ctx.rect(left, bbox.top, right - left, bbox.height);
  }
  ctx.clip();
  ctx.beginPath();
  for (let x = bbox.left - bbox.height; x < bbox.left + bbox.width; x += 9 * devicePixelRatio) {
    ctx.moveTo(x, bbox.top + bbox.height);
    ctx.lineTo(x + bbox.height, bbox.top);
  }
  if (gaps.length) {
    ctx.strokeStyle = colour('hatch');
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.stroke();
  }
  ctx.restore();
}

export function mountCheckTimelines() {
  if (data.timelines.length === 0) return;
  const root = must('check-timelines');
  root.append(make('div', { class: 'sep' }, 'Checks'));
  for (const timeline of data.timelines) {
    const track = make('div', { class: 'track' });
    for (const [from, to, verdict] of timeline.spans) {
      const part = make('i', { 'data-verdict': verdict });
      track.append(part);
      redraws.push(() => lay(part, from, to));
    }
    const text = make('span');
    root.append(make('div', { class: 'check-timeline', 'data-priority': timeline.priority }, track, make('div', { class: 'name' }, make('b', {}, timeline.label), text)));
    const starts = timeline.spans.map(([from]) => from);
    followers.push(() => {
      const span = timeline.spans[Math.max(0, indexAt(starts, view.at))];
      text.textContent = span ? [REASONS[/** @type {keyof typeof REASONS} */ (span[2])], span[3]].filter(Boolean).join(': ') : '';
    });
  }
}
