// One signal's last minute at its full size, in a sheet: limit drawn, gaps hatched, read off by finger or key, zoomed, held.

import uPlot from '../../vendor/uPlot.esm.js';
import { field, html, listen, need, setAttribute, setText, setWords, show } from '../core/dom.js';
import { write } from '../core/ink.js';
import { mountFingers } from './chart-fingers.js';
import { openSheet } from '../shell/sheet.js';
import { SPAN, STEP_S, extent, unknown_s, viewAfter } from './trends-layout.js';
import { colours } from './spark.js';
import { nowOf } from './trend-feed.js';
import { shownIn } from '../core/units.js';
import { age, fixed, signed } from '../core/format.js';

const WHOLE = /** @type {[number, number]} */ ([-SPAN * STEP_S, 0]);

/**
 * @typedef {import('./trends-layout.js').Spec} Spec
 * @typedef {import('./trends-layout.js').Course} Course
 */

/**
 * @param {Spec} spec
 * @param {import('./trend-feed.js').Trends} trends
 * @param {import('../core/store.js').Store} store
 */
export async function open(spec, trends, store) {
  const sheet = /** @type {HTMLDialogElement} */ (need(document, '#sheet-chart'));
  if (sheet.open) return;
  await Promise.all([styled(), document.fonts.load('14px "catgraph numerals"').catch(() => [])]);
  openSheet(sheet);
  new Chart(sheet, spec, trends, store);
}

class Chart {
  view = WHOLE;
  /** The moment the drawing is held at, as a step and its part; null: it runs. @type {number | null} */
  held = null;
  held_ms = 0;
  /** The moment that is read [s before the right edge]; null: none. @type {number | null} */
  read_s = null;
  /** @type {Course} */
  course;

  /** @param {HTMLDialogElement} sheet @param {Spec} spec @param {import('./trend-feed.js').Trends} trends @param {import('../core/store.js').Store} store */
  constructor(sheet, spec, trends, store) {
    this.sheet = sheet;
    this.spec = spec;
    this.trends = trends;
    this.store = store;
    this.course = trends.course(spec);
    this.host = field(sheet, 'plot');
    this.plot = this.#build();
    const key = (/** @type {string} */ name, /** @type {() => void} */ act) => listen(field(sheet, name), 'click', act);
    const anew = () => {
      this.plot.destroy();
      this.plot = this.#build();
      this.draw();
    };
    this.stops = [
      store.on('draw', () => this.draw()),
      key('hold', () => this.#hold()),
      key('nearer', () => this.#change({ zoom: 0.5 })),
      key('farther', () => this.#change({ zoom: 2 })),
      key('earlier', () => this.#change({ pan: -0.5 })),
      key('later', () => this.#change({ pan: 0.5 })),
      listen(this.host, 'keydown', (event) => this.#pressed(event)),
      mountFingers(this.host, () => this.plot, { change: (change) => this.#change(change), read: (at_s) => this.read(at_s) }),
      listen(window, 'catgraph-theme', anew),
      listen(matchMedia('(prefers-color-scheme: light)'), 'change', anew),
      listen(window, 'resize', anew),
    ];
    sheet.addEventListener('close', () => this.#end(), { once: true });
    setText(field(sheet, 'title'), `${spec.title}, last minute`);
    this.#hold(false);
    this.read(null);
  }

  #end() {
    for (const stop of this.stops) stop();
    this.plot.destroy();
    this.host.replaceChildren();
  }

  /** The right edge, as a step and its part. */
  get edge() {
    return this.held ?? this.trends.now;
  }

  draw() {
    this.course = this.trends.course(this.spec, this.edge);
    this.plot.setData(this.#data(), true);
    this.#say();
  }

  /** @returns {uPlot.AlignedData} */
  #data() {
    const shown = (/** @type {number | null} */ value) => shownIn(value, this.spec.unit).value;
    const { times_s, lowest, highest } = this.course;
    return /** @type {any} */ ([times_s, lowest.map(shown), highest.map(shown)]);
  }

  /** @param {number | null | undefined} value of the wire */
  #words(value) {
    return (this.spec.isSigned ? signed : fixed)(shownIn(value, this.spec.unit).value, this.spec.digits);
  }

  #say() {
    const { sheet, spec, course } = this;
    const { unit } = shownIn(0, spec.unit);
    const [from_s, to_s] = this.view;
    const { low, high } = extent(course, from_s, to_s);
    const now = nowOf(spec, this.store);
    setText(field(sheet, 'lowest'), this.#words(low));
    setText(field(sheet, 'highest'), this.#words(high));
    write(field(sheet, 'now'), now.ink, now.text, field(sheet, 'now-unit'), now.value === null ? '' : unit);
    for (const name of ['lowest-unit', 'highest-unit']) setText(field(sheet, name), Number.isNaN(low) ? '' : unit);
    const lost_s = unknown_s(course, from_s, to_s);
    const part = from_s === WHOLE[0] && to_s === 0 ? 'Whole minute' : `${fixed(from_s, 0)} s to ${fixed(to_s, 0)} s`;
    const limit = spec.limit === null ? null : this.store.limit(spec.limit);
    setWords(field(sheet, 'part'), [part, limit === null ? '' : `limit ${this.#words(limit)} ${unit}`, lost_s > 0.5 ? `hatched: ${age(lost_s)} s unknown` : ''].filter(Boolean).join(' · '));
    show(field(sheet, 'held'), this.held !== null);
    if (this.held !== null) setWords(field(sheet, 'held'), `Held for ${age((this.store.now() - this.held_ms) / 1000)} s: not live`);
    setAttribute(field(sheet, 'nearer'), 'aria-disabled', to_s - from_s <= 4);
    setAttribute(field(sheet, 'farther'), 'aria-disabled', to_s - from_s >= -WHOLE[0]);
    setAttribute(field(sheet, 'earlier'), 'aria-disabled', from_s <= WHOLE[0]);
    setAttribute(field(sheet, 'later'), 'aria-disabled', to_s >= 0);
    setWords(field(sheet, 'readout'), this.#readout() ?? 'Touch the chart to read a moment.');
  }

  /** What was at the moment that is read. */
  #readout() {
    if (this.read_s === null) return null;
    const at_s = this.read_s;
    const { unit } = shownIn(0, this.spec.unit);
    const when = `${fixed(at_s)} s`;
    if (this.course.gaps.some(([a, b]) => at_s >= a && at_s <= b)) return `${when}: nothing known`;
    const found = extent(this.course, at_s - STEP_S / 2 - 1e-6, at_s + STEP_S / 2);
    const { low, high } = Number.isNaN(found.low) ? extent(this.course, at_s - 0.5, at_s + 0.5) : found;
    if (Number.isNaN(low)) return `${when}: ${this.spec.name === 'distance' ? 'none in range' : 'no number'}`;
    const [a, b] = [this.#words(low), this.#words(high)];
    return `${when}: ${a === b ? a : `${a} to ${b}`} ${unit}`;
  }

  /** Read a moment, or none. It stays where it is while the line moves on. @param {number | null} at_s */
  read(at_s) {
    this.read_s = at_s === null ? null : Math.max(this.view[0], Math.min(this.view[1], at_s));
    setAttribute(this.host, 'aria-valuenow', (this.read_s ?? 0).toFixed(1));
    setAttribute(this.host, 'aria-valuetext', this.#readout() ?? 'no moment chosen');
    this.plot.redraw(false, false);
    this.#say();
  }

  /** @param {boolean} [wanted] */
  #hold(wanted = this.held === null) {
    this.held = wanted ? this.trends.now : null;
    this.held_ms = this.store.now();
    setAttribute(field(this.sheet, 'hold'), 'aria-pressed', String(wanted));
    setText(field(this.sheet, 'hold-word'), wanted ? 'Go on' : 'Hold');
    this.draw();
  }

  /** @param {Parameters<typeof viewAfter>[1]} change */
  #change(change) {
    this.view = viewAfter(this.view, change);
    this.draw();
  }

  /** @param {KeyboardEvent} event */
  #pressed(event) {
    const width_s = this.view[1] - this.view[0];
    const from = this.read_s ?? this.view[1];
    const acts = /** @type {Record<string, () => void>} */ ({
      ArrowLeft: () => this.read(from - Math.max(STEP_S, width_s / 60)), ArrowRight: () => this.read(from + Math.max(STEP_S, width_s / 60)),
      Home: () => this.read(this.view[0]), End: () => this.read(this.view[1]),
      PageDown: () => this.#change({ pan: -0.5 }), PageUp: () => this.#change({ pan: 0.5 }),
      '+': () => this.#change({ zoom: 0.5 }), '=': () => this.#change({ zoom: 0.5 }), '-': () => this.#change({ zoom: 2 }),
    });
    if (event.ctrlKey || event.metaKey || event.altKey || !acts[event.key]) return;
    event.preventDefault();
    acts[event.key]?.();
  }

  #build() {
    const { spec } = this;
    const palette = { ...colours(this.sheet), ink2: getComputedStyle(field(this.sheet, 'part')).color };
    const face = `14px ${getComputedStyle(document.documentElement).getPropertyValue('--digits').trim()}`;
    const axis = { stroke: palette.ink2, font: face, grid: { stroke: palette.line, width: 1 }, ticks: { show: false } };
    return new uPlot({
      width: this.host.clientWidth || 380,
      height: this.host.clientHeight || 240,
      padding: [14, 22, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      select: { show: false, left: 0, top: 0, width: 0, height: 0 },
      scales: { x: { time: false, range: () => this.view }, y: { range: () => this.#ends() } },
      axes: [
        { ...axis, size: 30, space: 56, values: (_, splits) => splits.map((at_s) => (at_s === 0 ? 'now' : `${fixed(at_s, at_s % 1 ? 1 : 0)} s`)) },
        { ...axis, size: 48, space: 32, values: (_, splits) => splits.map((value) => fixed(value, splits.some((one) => one % 1) ? 1 : 0)) },
      ],
      series: [{}, ...[0, 1].map(() => ({ stroke: palette.ink, width: 2, spanGaps: false, points: { show: false } }))],
      bands: [{ series: [2, 1], fill: palette.ink }],
      hooks: { drawAxes: [(plot) => this.#under(plot, palette)], draw: [(plot) => this.#over(plot, palette)] },
    }, this.#data(), this.host);
  }

  /** @returns {[number, number]} */
  #ends() {
    const { low, high, isEmpty } = this.course;
    const [a, b] = this.spec.ends(this.store.frame?.limits ?? {}, isEmpty ? 0 : low, isEmpty ? 0 : high);
    return [shownIn(a, this.spec.unit).value, shownIn(b, this.spec.unit).value];
  }

  /** What nobody knows. @param {uPlot} plot @param {Record<string, string>} palette */
  #under(plot, palette) {
    const { ctx: g, bbox } = plot;
    const dpr = devicePixelRatio || 1;
    g.save();
    g.beginPath();
    for (const [from_s, to_s] of this.course.gaps) {
      const [a, b] = [from_s, to_s].map((at_s) => plot.valToPos(Math.max(this.view[0], Math.min(this.view[1], at_s)), 'x', true));
      if (a !== undefined && b !== undefined && b > a) g.rect(a, bbox.top, Math.max(b - a, 2 * dpr), bbox.height);
    }
    g.clip();
    g.strokeStyle = palette['hatch'] ?? '';
    g.lineWidth = 2.5 * dpr;
    g.beginPath();
    for (let x = bbox.left - bbox.height; x < bbox.left + bbox.width; x += 10 * dpr) {
      g.moveTo(x, bbox.top + bbox.height);
      g.lineTo(x + bbox.height, bbox.top);
    }
    g.stroke();
    g.restore();
  }

  /** The limit and the moment that is read. @param {uPlot} plot @param {Record<string, string>} palette */
  #over(plot, palette) {
    const { ctx: g, bbox } = plot;
    const dpr = devicePixelRatio || 1;
    const limit = this.spec.limit === null ? null : this.store.limit(this.spec.limit);
    g.save();
    g.strokeStyle = g.fillStyle = palette['you'] ?? '';
    g.lineWidth = 2 * dpr;
    if (limit !== null) {
      const y = plot.valToPos(shownIn(limit, this.spec.unit).value, 'y', true);
      g.setLineDash([8 * dpr, 5 * dpr]);
      g.beginPath();
      g.moveTo(bbox.left, y);
      g.lineTo(bbox.left + bbox.width, y);
      g.stroke();
      g.setLineDash([]);
    }
    if (this.read_s !== null) {
      const x = plot.valToPos(this.read_s, 'x', true);
      g.beginPath();
      g.moveTo(x, bbox.top);
      g.lineTo(x, bbox.top + bbox.height);
      g.stroke();
    }
    g.restore();
  }
}

/** uPlot's own style sheet, once. @returns {Promise<void>} */
function styled() {
  if (document.querySelector('link[data-chart]')) return Promise.resolve();
  return new Promise((resolve) => {
    const link = html('link', { rel: 'stylesheet', href: new URL('../../vendor/uPlot.min.css', import.meta.url).href, 'data-chart': '' });
    link.addEventListener('load', () => resolve());
    link.addEventListener('error', () => resolve()); // it lacks beauty, not truth
    document.head.append(link);
  });
}
