// The plots of `catgraph check`: one time axis for alarm bars, curves, checks and the track; a needle reads them all.
// What stands above this in the file is uPlot.

/**
 * @typedef {{label: string, ink: 'ink' | 'ink2' | 'order' | 'you', limit: boolean, t: number[], v: (number | null)[]}} Curve
 * @typedef {{title: string, unit: string, digits: number, curves: Curve[]}} Panel
 * @typedef {{alarm: string, title: string, priority: string, from: number, to: number, open: boolean, said: number[],
 *   hidden: [number, number][]}} Bar
 * @typedef {{label: string, priority: string, spans: [number, number, string, string][]}} Ribbon
 * @typedef {{from: number, to: number, startMs: number | null, panels: Panel[], track: {t: number[], e: number[],
 *   n: number[]} | null, episodes: Bar[], before: Bar[], ribbons: Ribbon[], injected: [string, number, number][]}} Data
 */

const GUTTER = 52; // as in report.css
const SIDE = 16;
const LEAST_S = 2; // no zoom shows less
const AROUND_S = 6; // an alarm is shown with so much before and after it
const ICONS = { critical: 'crit', warning: 'warn', advisory: 'info' };
const REASONS = { ok: 'in order', fault: '', unknown: 'not checked' };

/** @type {Data} */
const data = JSON.parse(must('data').textContent ?? '');
const worst = data.episodes.find((bar) => bar.priority === 'critical') ?? data.episodes[0];
const view = { from: data.from, to: data.to, at: worst ? worst.from : (data.from + data.to) / 2 };
/** @type {(() => void)[]} what is redrawn when the view changes */
const redraws = [];
/** @type {(() => void)[]} what follows the needle */
const followers = [];

// -- pure ------------------------------------------------------------------------------------------------------------

/** The index of the last time at or before `at`, −1 before the first. */
export function indexAt(/** @type {number[]} */ times, /** @type {number} */ at) {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= at) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** The view from `from` to `to`, moved and stretched so that it lies within the drive. */
export function within(/** @type {number} */ from, /** @type {number} */ to, /** @type {number} */ first, /** @type {number} */ last) {
  const whole = last - first;
  const span = Math.min(Math.max(to - from, Math.min(LEAST_S, whole)), whole);
  const middle = (from + to) / 2;
  const start = Math.min(Math.max(middle - span / 2, first), last - span);
  return { from: start, to: start + span };
}

/** 12.3 s, from ten minutes on 12:34.5. */
export function clock(/** @type {number} */ seconds) {
  if (Math.abs(seconds) < 600) return `${seconds.toFixed(1)} s`;
  const tenths = Math.round(seconds * 10);
  const minutes = Math.floor(tenths / 600);
  const rest = ((tenths % 600) / 10).toFixed(1).padStart(4, '0');
  return minutes < 60 ? `${minutes}:${rest}` : `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, '0')}:${rest}`;
}

/** Bars of one alarm stand in one lane. */
export function lanesOf(/** @type {Bar[]} */ bars) {
  /** @type {Map<string, {title: string, priority: string, bars: {bar: Bar, index: number}[]}>} */
  const lanes = new Map();
  bars.forEach((bar, index) => {
    const lane = lanes.get(bar.alarm) ?? { title: bar.title, priority: bar.priority, bars: [] };
    lane.bars.push({ bar, index });
    lanes.set(bar.alarm, lane);
  });
  return [...lanes.values()];
}

/** One table for all curves of a panel; undefined: this curve has no point there, null: it has a gap. */
export function joined(/** @type {Curve[]} */ curves) {
  const times = [...new Set(curves.flatMap((curve) => curve.t))].sort((a, b) => a - b);
  const place = new Map(times.map((time, index) => [time, index]));
  const columns = curves.map((curve) => {
    /** @type {(number | null | undefined)[]} */
    const column = new Array(times.length).fill(undefined);
    curve.t.forEach((time, index) => { column[/** @type {number} */ (place.get(time))] = curve.v[index]; });
    if (!curve.limit) return column;
    /** @type {number | null} */
    let held = null; // a limit is told where it changes, and stands between
    return column.map((value) => (held = value === undefined ? held : value));
  });
  return [times, ...columns];
}

/** A round length of about a fifth of `metres`. */
export function roundStep(/** @type {number} */ metres) {
  const rough = metres / 5;
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= rough) ?? rough;
}

// -- document --------------------------------------------------------------------------------------------------------

function must(/** @type {string} */ id) {
  const found = document.getElementById(id);
  if (!found) throw new Error(`no ${id}`);
  return found;
}

/** @param {string} tag @param {Record<string, string>} [attributes] @param {(Node | string)[]} children */
function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

function icon(/** @type {string} */ name) {
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
  svg.setAttribute('class', 'i');
  svg.setAttribute('aria-hidden', 'true');
  const use = document.createElementNS('http://www.w3.org/2000/svg', 'use');
  use.setAttribute('href', `#${name}`);
  svg.append(use);
  return svg;
}

/** @type {Map<string, string>} */
const colours = new Map();
const probe = document.createElement('i');
probe.hidden = true;
document.body.append(probe);

function colour(/** @type {string} */ token) {
  let found = colours.get(token);
  if (found === undefined) {
    probe.style.color = `var(--${token})`;
    found = getComputedStyle(probe).color;
    colours.set(token, found);
  }
  return found;
}

const INKS = { ink: 'ink', ink2: 'edge', order: 'order', you: 'you' };
const timeline = must('timeline');

function spanPx() {
  return Math.max(1, timeline.clientWidth - GUTTER - SIDE);
}

function xOf(/** @type {number} */ at) {
  return GUTTER + ((at - view.from) / (view.to - view.from)) * spanPx();
}

function timeAt(/** @type {number} */ clientX) {
  const x = clientX - timeline.getBoundingClientRect().left - GUTTER;
  const at = view.from + (x / spanPx()) * (view.to - view.from);
  return Math.min(Math.max(at, view.from), view.to);
}

function show(/** @type {number} */ from, /** @type {number} */ to) {
  Object.assign(view, within(from, to, data.from, data.to));
  view.at = Math.min(Math.max(view.at, view.from), view.to);
  for (const redraw of redraws) redraw();
  follow();
}

function go(/** @type {number} */ at) {
  view.at = Math.min(Math.max(at, data.from), data.to);
  if (view.at < view.from || view.at > view.to) {
    const half = (view.to - view.from) / 2;
    show(view.at - half, view.at + half);
  } else follow();
}

let isDue = false;
function follow() {
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(() => {
    isDue = false;
    for (const follower of followers) follower();
  });
}

/** Places a bar by its times, in parts of the track's width. */
function lay(/** @type {HTMLElement} */ bar, /** @type {number} */ from, /** @type {number} */ to) {
  const span = view.to - view.from;
  const left = Math.max(-1, (from - view.from) / span);
  const right = Math.min(2, (to - view.from) / span);
  bar.hidden = right < 0 || left > 1;
  bar.style.left = `${left * 100}%`;
  bar.style.width = `${Math.max(0, right - left) * 100}%`;
}

// -- alarm bars ------------------------------------------------------------------------------------------------------

function mountLanes() {
  const root = must('lanes');
  for (const lane of lanesOf(data.episodes)) {
    const track = make('div', { class: 'track' });
    for (const { bar, index } of lane.bars) {
      const button = /** @type {HTMLButtonElement} */ (make('button', {
        type: 'button',
        'aria-label': `${bar.title}, ${clock(bar.from)} to ${bar.open ? 'the end' : clock(bar.to)}`,
      }));
      button.title = button.getAttribute('aria-label') ?? '';
      button.addEventListener('click', (event) => { event.stopPropagation(); choose(index); });
      track.append(button);
      const hidden = bar.hidden.map(([from, to]) => ({ from, to, element: make('i', { class: 'hidden' }) }));
      track.append(...hidden.map(({ element }) => element));
      redraws.push(() => {
        lay(button, bar.from, bar.to);
        for (const part of hidden) lay(part.element, part.from, part.to);
      });
    }
    root.append(make('div', { class: 'lane', 'data-priority': lane.priority }, track,
      make('div', { class: 'name' }, icon(ICONS[/** @type {keyof typeof ICONS} */ (lane.priority)] ?? 'info'), lane.title)));
  }
  for (const lane of lanesOf(data.before)) {
    addMarks(root, 'before', `before: ${lane.title}`, lane.bars.map(({ bar }) => [bar.from, bar.to]));
  }
  for (const [name, from, to] of data.injected) addMarks(root, 'injected', `injected: ${name}`, [[from, to]]);
}

/** @param {HTMLElement} root @param {string} kind @param {string} name @param {number[][]} spans */
function addMarks(root, kind, name, spans) {
  const track = make('div', { class: 'track' });
  for (const [from, to] of spans) {
    const mark = make('i');
    track.append(mark);
    redraws.push(() => lay(mark, from, to));
  }
  root.append(make('div', { class: 'lane', 'data-priority': kind }, track, make('div', { class: 'name' }, name)));
}

// -- curves ----------------------------------------------------------------------------------------------------------

function mountPanel(/** @type {Panel} */ panel) {
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
  }, joined(panel.curves), body);
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

/** @type {(() => void)[]} what is drawn again in other colours */
const repaints = [];

function shortClock(/** @type {number} */ seconds) {
  if (view.to >= 600) return clock(seconds).replace(/\.0$/, '');
  return `${Number(seconds.toFixed(2))}`;
}

/** The same however far the view goes in, so that curves can be compared; from zero, with a little air. */
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

/** Where the panel's own curve has a gap, nothing is known: hatched, never bridged. */
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

// -- checks ----------------------------------------------------------------------------------------------------------

function mountRibbons() {
  if (data.ribbons.length === 0) return;
  const root = must('ribbons');
  root.append(make('div', { class: 'sep' }, 'Checks'));
  for (const ribbon of data.ribbons) {
    const track = make('div', { class: 'track' });
    for (const [from, to, verdict] of ribbon.spans) {
      const part = make('i', { 'data-verdict': verdict });
      track.append(part);
      redraws.push(() => lay(part, from, to));
    }
    const said = make('span');
    root.append(make('div', { class: 'ribbon', 'data-priority': ribbon.priority }, track, make('div', { class: 'name' }, make('b', {}, ribbon.label), said)));
    const starts = ribbon.spans.map(([from]) => from);
    followers.push(() => {
      const span = ribbon.spans[Math.max(0, indexAt(starts, view.at))];
      said.textContent = span ? [REASONS[/** @type {keyof typeof REASONS} */ (span[2])], span[3]].filter(Boolean).join(': ') : '';
    });
  }
}

// -- track -----------------------------------------------------------------------------------------------------------

function mountTrack() {
  const way = data.track;
  if (!way) return;
  const section = /** @type {HTMLElement} */ (document.querySelector('.way'));
  section.hidden = false;
  const canvas = /** @type {HTMLCanvasElement} */ (must('track'));
  const said = must('track-said');
  const low = { e: Math.min(...way.e), n: Math.min(...way.n) };
  const high = { e: Math.max(...way.e), n: Math.max(...way.n) };
  const middle = { e: (low.e + high.e) / 2, n: (low.n + high.n) / 2 };
  const extent = { e: Math.max(high.e - low.e, 4), n: Math.max(high.n - low.n, 4) };
  /** @type {{x: (e: number) => number, y: (n: number) => number} | null} */
  let place = null;

  const draw = () => {
    const { ctx, width, height } = fitted(canvas);
    const scale = Math.min((width - 48) / extent.e, (height - 56) / extent.n);
    const x = (/** @type {number} */ e) => width / 2 + (e - middle.e) * scale;
    const y = (/** @type {number} */ n) => height / 2 - (n - middle.n) * scale;
    place = { x, y };
    const step = roundStep(Math.max(width, height) / scale);
    ctx.lineWidth = 1;
    ctx.strokeStyle = colour('line');
    ctx.beginPath();
    const west = middle.e - width / 2 / scale;
    for (let e = Math.ceil(west / step) * step; x(e) < width; e += step) { ctx.moveTo(x(e), 0); ctx.lineTo(x(e), height); }
    const south = middle.n - height / 2 / scale;
    for (let n = Math.ceil(south / step) * step; y(n) > 0; n += step) { ctx.moveTo(0, y(n)); ctx.lineTo(width, y(n)); }
    ctx.stroke();
    stroke(ctx, way, x, y, 0, way.t.length - 1, colour('edge'), 2);
    const first = Math.max(0, indexAt(way.t, view.from));
    const last = indexAt(way.t, view.to);
    stroke(ctx, way, x, y, first, last, colour('ink'), 3);
    for (const bar of data.episodes) {
      if (bar.priority === 'advisory') continue;
      const from = Math.max(0, indexAt(way.t, bar.from));
      stroke(ctx, way, x, y, from, Math.max(from, indexAt(way.t, bar.to)), colour(bar.priority === 'critical' ? 'crit' : 'warn'), 6);
    }
    ctx.fillStyle = colour('ink');
    for (let index = 0, due = way.t[0]; index < way.t.length; index += 1) {
      if (way.t[index] >= due) { disc(ctx, x(way.e[index]), y(way.n[index]), 3.5); due += dotEvery(); }
    }
    const now = Math.max(0, indexAt(way.t, view.at));
    const nose = headingAt(way, now);
    dart(ctx, x(way.e[now]), y(way.n[now]), nose);
    scaleBar(ctx, height, step * scale, step);
    north(ctx, width);
  };
  const dotEvery = () => (data.to - data.from > 600 ? 60 : 10);
  said.textContent = `A dot each ${dotEvery()} s; thick where an alarm stood. Point at it to read the moment.`;
  redraws.push(draw);
  repaints.push(draw);
  followers.push(draw);
  const point = (/** @type {PointerEvent} */ event) => {
    if (!place) return;
    const box = canvas.getBoundingClientRect();
    const [px, py] = [event.clientX - box.left, event.clientY - box.top];
    let best = 0;
    let least = Infinity;
    for (let index = 0; index < way.t.length; index += 1) {
      const far = (place.x(way.e[index]) - px) ** 2 + (place.y(way.n[index]) - py) ** 2;
      if (far < least) [least, best] = [far, index];
    }
    go(way.t[best]);
  };
  canvas.addEventListener('pointermove', point);
  canvas.addEventListener('pointerdown', point);
}

/** @typedef {{t: number[], e: number[], n: number[]}} Way */

/** @param {CanvasRenderingContext2D} ctx @param {Way} way @param {(e: number) => number} x @param {(n: number) => number} y
 * @param {number} first @param {number} last @param {string} ink @param {number} width */
function stroke(ctx, way, x, y, first, last, ink, width) {
  ctx.beginPath();
  for (let index = first; index <= last; index += 1) {
    if (index > first && way.t[index] - way.t[index - 1] > 5) ctx.moveTo(x(way.e[index]), y(way.n[index]));
    else ctx.lineTo(x(way.e[index]), y(way.n[index]));
  }
  ctx.strokeStyle = ink;
  ctx.lineWidth = width;
  ctx.lineJoin = ctx.lineCap = 'round';
  ctx.stroke();
}

/** The direction of the way around a point, clockwise from north; null while standing. */
function headingAt(/** @type {Way} */ way, /** @type {number} */ now) {
  for (let back = 1; back < 60; back += 1) {
    const [from, to] = [Math.max(0, now - back), Math.min(way.t.length - 1, now + back)];
    const [e, n] = [way.e[to] - way.e[from], way.n[to] - way.n[from]];
    if (Math.hypot(e, n) > 1.5) return Math.atan2(e, n);
  }
  return null;
}

/** @param {CanvasRenderingContext2D} ctx @param {number} x @param {number} y @param {number} radius */
function disc(ctx, x, y, radius) {
  ctx.beginPath();
  ctx.arc(x, y, radius, 0, 2 * Math.PI);
  ctx.fill();
}

/** @param {CanvasRenderingContext2D} ctx @param {number} x @param {number} y @param {number | null} heading */
function dart(ctx, x, y, heading) {
  ctx.save();
  ctx.translate(x, y);
  ctx.fillStyle = colour('ink');
  ctx.strokeStyle = colour('panel');
  ctx.lineWidth = 3;
  ctx.beginPath();
  if (heading === null) ctx.arc(0, 0, 8, 0, 2 * Math.PI);
  else {
    ctx.rotate(heading);
    ctx.moveTo(0, -15); ctx.lineTo(10, 12); ctx.lineTo(0, 6); ctx.lineTo(-10, 12); ctx.closePath();
  }
  ctx.stroke();
  ctx.fill();
  ctx.restore();
}

/** @param {CanvasRenderingContext2D} ctx @param {number} height @param {number} width @param {number} metres */
function scaleBar(ctx, height, width, metres) {
  ctx.fillStyle = ctx.strokeStyle = colour('ink');
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.moveTo(12, height - 18); ctx.lineTo(12, height - 12); ctx.lineTo(12 + width, height - 12); ctx.lineTo(12 + width, height - 18);
  ctx.stroke();
  ctx.font = '15px "catgraph numerals", system-ui';
  ctx.textAlign = 'left';
  ctx.fillText(metres >= 1000 ? `${metres / 1000} km` : `${Number(metres.toPrecision(2))} m`, 12, height - 24);
}

function north(/** @type {CanvasRenderingContext2D} */ ctx, /** @type {number} */ width) {
  ctx.beginPath();
  ctx.moveTo(width - 18, 10); ctx.lineTo(width - 11, 30); ctx.lineTo(width - 18, 25); ctx.lineTo(width - 25, 30); ctx.closePath();
  ctx.fill();
  ctx.font = '700 14px system-ui';
  ctx.textAlign = 'center';
  ctx.fillText('N', width - 18, 46);
}

/** A canvas as sharp as the screen, cleared. */
function fitted(/** @type {HTMLCanvasElement} */ canvas) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const ctx = /** @type {CanvasRenderingContext2D} */ (canvas.getContext('2d'));
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.clearRect(0, 0, width, height);
  return { ctx, width, height };
}

// -- rail ------------------------------------------------------------------------------------------------------------

function mountRail() {
  /** @type {HTMLElement} */ (document.querySelector('.rail')).hidden = false;
  const canvas = /** @type {HTMLCanvasElement} */ (must('overview'));
  const scrub = /** @type {HTMLInputElement} */ (must('scrub'));
  Object.assign(scrub, { min: String(data.from), max: String(data.to), step: '0.1', value: String(data.from) });
  scrub.addEventListener('input', () => go(Number(scrub.value)));
  const curve = data.panels[0]?.curves.findLast((one) => !one.limit);
  const draw = () => {
    const { ctx, width, height } = fitted(canvas);
    const x = (/** @type {number} */ at) => 8 + ((at - data.from) / (data.to - data.from)) * (width - 16);
    const base = height - 6;
    if (view.to - view.from < data.to - data.from - 0.01) {
      ctx.fillStyle = colour('panel');
      ctx.fillRect(x(view.from), 0, x(view.to) - x(view.from), height);
    }
    ctx.strokeStyle = colour('edge');
    ctx.lineWidth = 1.5;
    ctx.beginPath(); ctx.moveTo(8, base); ctx.lineTo(width - 8, base); ctx.stroke();
    if (curve) {
      const values = curve.v.map((value) => Math.abs(value ?? 0));
      const most = values.reduce((a, b) => Math.max(a, b), 0.001);
      ctx.strokeStyle = colour('ink');
      ctx.lineWidth = 2;
      ctx.beginPath();
      const step = Math.max(1, Math.floor(values.length / (width * 2)));
      for (let index = 0; index < values.length; index += step) ctx.lineTo(x(curve.t[index]), base - (values[index] / most) * (height - 24));
      ctx.stroke();
    }
    for (const bar of [...data.episodes].reverse()) mark(ctx, bar.priority, x(bar.from));
    ctx.fillStyle = colour('you');
    ctx.fillRect(x(view.at) - 1.5, 0, 3, height);
  };
  redraws.push(draw);
  repaints.push(draw);
  followers.push(() => {
    draw();
    scrub.value = String(view.at);
    scrub.setAttribute('aria-valuetext', clock(view.at));
    must('now').textContent = clock(view.at);
    must('wall').textContent = data.startMs === null ? '' : new Date(data.startMs + view.at * 1000).toISOString().slice(11, 19);
  });
  const order = data.episodes.map((bar, index) => ({ at: bar.from, index }));
  const previous = /** @type {HTMLButtonElement} */ (must('previous'));
  const following = /** @type {HTMLButtonElement} */ (must('following'));
  previous.disabled = following.disabled = order.length === 0;
  previous.hidden = following.hidden = order.length === 0;
  previous.addEventListener('click', () => choose((order.findLast(({ at }) => at < view.at - 0.05) ?? order[order.length - 1]).index));
  following.addEventListener('click', () => choose((order.find(({ at }) => at > view.at + 0.05) ?? order[0]).index));
  must('all').addEventListener('click', () => show(data.from, data.to));
}

/** @param {CanvasRenderingContext2D} ctx @param {string} priority @param {number} x */
function mark(ctx, priority, x) {
  ctx.beginPath();
  if (priority === 'critical') { ctx.moveTo(x, 0); ctx.lineTo(x + 7, 7); ctx.lineTo(x, 14); ctx.lineTo(x - 7, 7); }
  else if (priority === 'warning') { ctx.moveTo(x, 0); ctx.lineTo(x + 7, 13); ctx.lineTo(x - 7, 13); }
  else ctx.arc(x, 7, 4.5, 0, 2 * Math.PI);
  ctx.closePath();
  ctx.fillStyle = colour(priority === 'critical' ? 'crit' : priority === 'warning' ? 'warn' : 'panel');
  ctx.strokeStyle = colour(priority === 'warning' ? 'warn-edge' : priority === 'critical' ? 'crit' : 'ink');
  ctx.lineWidth = 1.5;
  ctx.fill();
  ctx.stroke();
}

// -- choosing --------------------------------------------------------------------------------------------------------

/** Jumps to an alarm: shows it with what came before and after. */
function choose(/** @type {number} */ index) {
  const bar = data.episodes[index];
  for (const row of document.querySelectorAll('.alarm')) {
    if (/** @type {HTMLElement} */ (row).dataset.episode === String(index)) row.setAttribute('aria-current', 'true');
    else row.removeAttribute('aria-current');
  }
  view.at = bar.from;
  show(bar.from - AROUND_S, Math.min(bar.to, bar.from + 60) + AROUND_S);
}

function mountChoices() {
  for (const row of document.querySelectorAll('.alarm')) {
    row.addEventListener('click', () => {
      choose(Number(/** @type {HTMLElement} */ (row).dataset.episode));
      reveal();
    });
  }
  for (const row of document.querySelectorAll('.change')) {
    const { at, until } = /** @type {HTMLElement} */ (row).dataset;
    row.addEventListener('click', () => {
      view.at = Number(at);
      show(Number(at) - AROUND_S, Math.min(Number(until), Number(at) + 60) + AROUND_S);
      reveal();
    });
  }
}

/** Where the columns stand one below the other, the plots come into sight. */
function reveal() {
  const box = timeline.getBoundingClientRect();
  if (box.top > innerHeight * 0.7 || box.bottom < innerHeight * 0.3) must('h-time').scrollIntoView();
}

function mountPointer() {
  const needle = must('needle');
  const chosen = must('chosen');
  /** @type {number | null} */
  let pressed = null;
  followers.push(() => {
    needle.hidden = false;
    needle.style.transform = `translateX(${xOf(view.at)}px)`;
  });
  const move = (/** @type {PointerEvent} */ event) => {
    if (pressed !== null && event.pointerType === 'mouse') {
      const [from, to] = [Math.min(pressed, event.clientX), Math.max(pressed, event.clientX)];
      const left = timeline.getBoundingClientRect().left;
      chosen.hidden = to - from < 6;
      chosen.style.left = `${from - left}px`;
      chosen.style.width = `${to - from}px`;
    }
    go(timeAt(event.clientX));
  };
  timeline.addEventListener('pointermove', move);
  timeline.addEventListener('pointerdown', (event) => {
    if (event.target instanceof Element && event.target.closest('button')) return;
    if (event.pointerType === 'mouse') {
      pressed = event.clientX;
      timeline.setPointerCapture(event.pointerId);
    }
    move(event);
  });
  const release = (/** @type {PointerEvent} */ event) => {
    const from = pressed;
    pressed = null;
    chosen.hidden = true;
    if (from !== null && event.type === 'pointerup' && Math.abs(event.clientX - from) >= 6) {
      const times = [timeAt(from), timeAt(event.clientX)].sort((a, b) => a - b);
      show(times[0], times[1]);
    }
  };
  timeline.addEventListener('pointerup', release);
  timeline.addEventListener('pointercancel', release);
  timeline.addEventListener('dblclick', () => show(data.from, data.to));
}

function mountTheme() {
  const dark = matchMedia('(prefers-color-scheme: dark)');
  const repaint = () => {
    colours.clear();
    for (const paint of repaints) paint();
  };
  must('theme').addEventListener('click', () => {
    const root = document.documentElement;
    const isDark = root.dataset.theme ? root.dataset.theme === 'dark' : dark.matches;
    root.dataset.theme = isDark ? 'light' : 'dark';
    repaint();
  });
  dark.addEventListener('change', repaint);
}

// -- begin -----------------------------------------------------------------------------------------------------------

await Promise.allSettled([document.fonts.load('14px "catgraph numerals"'), document.fonts.load('700 14px "catgraph numerals"')]);
mountLanes();
data.panels.forEach(mountPanel);
mountRibbons();
mountTrack();
mountRail();
mountChoices();
mountPointer();
mountTheme();
show(data.from, data.to);
new ResizeObserver(() => show(view.from, view.to)).observe(timeline);
