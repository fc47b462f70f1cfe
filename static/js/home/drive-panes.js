// Draws the panes of a drive's chart with uPlot: one signal each, on one clock, with limits, marks and what nobody knows.

import uPlot from '../../vendor/uPlot.esm.js';
import { html, setAttribute, setText, setSentence } from '../core/dom.js';
import { fixed } from '../core/format.js';
import { shownIn } from '../core/units.js';
import { clockWords, extentOf, lineOf, valueTicks, wholeLabel } from './drive-layout.js';
import { AXIS_PX, axisOf, BARE, INCRS_S, LOW_PX, marginOf, PaneStack, plotSize, roomFor } from './pane-stack.js';

/** A pane that is lower has no room for a text of two lines under its label [px]. */
const WORDS_PX = 72;
/** Width of the value axes [px]. */
const VALUES_PX = 38;

/**
 * @typedef {import('./drive-layout.js').Answer} Answer
 * @typedef {import('./drive-layout.js').View} View
 * @typedef {import('./trends-layout.js').Spec} Spec
 *
 * @typedef {object} Scene what is drawn
 * @property {Answer | null} answer
 * @property {View} view
 * @property {number | null} cursor_s
 * @property {{at_s: number, priority: string}[]} marks
 * @property {[number, number][]} unknown spans hatched in every pane
 * @property {Record<string, number>} limits of now, for the scales
 */

/** @extends {PaneStack<Pane>} */
export class Panes extends PaneStack {
  /** Until they get another size: to look at each picture would make the browser do its layout at once. @type {Panes['area'] | null} */
  #area = null;

  /** @param {HTMLElement} root @param {() => Scene} sceneOf */
  constructor(root, sceneOf) {
    super(root);
    this.sceneOf = sceneOf;
  }

  /** Builds a pane for each signal. @param {Spec[]} specs */
  build(specs) {
    this.stack(specs, (spec, isLast) => new Pane(spec, this, isLast));
    this.#area = null;
  }

  /** @override */
  resize() {
    super.resize();
    this.#area = null;
  }

  /** The left edge of the plots within the stage, and their width [px]. @returns {{left: number, width: number}} */
  get area() {
    if (this.#area) return this.#area;
    const { left, width } = this.box;
    const area = { left: left - /** @type {HTMLElement} */ (this.root.parentElement).getBoundingClientRect().left, width };
    if (width > 1) this.#area = area; // before, the first plot is not built
    return area;
  }

  /** New numbers. */
  fill() {
    for (const pane of this.panes) pane.fill();
  }

  /** The same numbers in another view. */
  move() {
    for (const { plot } of this.panes) plot.redraw(true, true);
  }
}

class Pane {
  /** @type {uPlot | null} */
  #plot = null;

  /** @param {Spec} spec @param {Panes} panes @param {boolean} isLast */
  constructor(spec, panes, isLast) {
    this.spec = spec;
    this.panes = panes;
    this.isLast = isLast;
    this.label = html('span', { class: 'lab' }, spec.label);
    this.value = html('span', { class: 'n v' });
    this.unit = html('span', { class: 'u' });
    this.host = html('div', { class: 'trends-plot' });
    this.element = html('div', { class: 'trends-pane', 'data-signal': spec.name, ...(isLast ? { 'data-last': true } : {}) }, html('div', { class: 'trends-head', title: spec.title }, this.label, html('span', { class: 'trends-value' }, this.value, this.unit)), this.host);
  }

  /** Once it has its place. */
  begin() {
    this.#plot = this.#build();
    this.fill();
  }

  get plot() {
    return /** @type {uPlot} */ (this.#plot); // since it has begun
  }

  fill() {
    const { answer } = this.panes.sceneOf();
    const trend = answer?.signals[this.spec.name];
    const line = answer && trend ? lineOf(trend, answer) : { times_s: [], lowest: [], highest: [] };
    const shown = (/** @type {number | null} */ value) => shownIn(value, this.spec.unit).value;
    const begin_s = (answer?.start_ms ?? 0) / 1000;
    this.plot.setData(/** @type {any} */ ([line.times_s.map((at_s) => begin_s + at_s), line.lowest.map(shown), line.highest.map(shown)]), false); // drawn with the view
  }

  /** Whether it is too low for a text of two lines beside it. */
  get isLow() {
    return this.plot.height < WORDS_PX;
  }

  resize() {
    const size = plotSize(this.host);
    if (size.width !== this.plot.width || size.height !== this.plot.height) this.plot.setSize(size);
  }

  /** Writes the value beside the pane. @param {string} text @param {string} ink @param {boolean} isNumber @param {boolean} [isThen] of the cursor, not of now */
  write(text, ink, isNumber, isThen = false) {
    setAttribute(this.element, 'data-then', isThen);
    setAttribute(this.value, 'data-ink', ink);
    setAttribute(this.value, 'data-words', isNumber ? null : true);
    setSentence(this.value, text);
    setText(this.unit, isNumber ? shownIn(0, this.spec.unit).unit : '');
  }

  #build() {
    const { palette } = this.panes;
    const axis = axisOf(palette);
    /** Without its clock [px]. @param {{height: number}} plot */
    const heightOf = ({ height }) => height - (this.isLast ? AXIS_PX : 0);
    /** @param {{height: number}} plot */
    const margin = (plot) => marginOf(heightOf(plot));
    const begin_s = () => (this.panes.sceneOf().answer?.start_ms ?? 0) / 1000;
    return new uPlot({
      ...plotSize(this.host),
      padding: [margin, 12, this.isLast ? 0 : margin, 0],
      ...BARE,
      scales: {
        x: { time: true, range: () => /** @type {[number, number]} */ (this.panes.sceneOf().view.map((at_s) => begin_s() + at_s)) },
        y: { range: () => this.#ends() },
      },
      axes: [
        { ...axis, size: this.isLast ? AXIS_PX : 0, space: 64, incrs: INCRS_S, values: (plot, splits, _axis, _space, apart_s) => splits.map((at_s) => (this.isLast ? wholeLabel(clockWords(at_s, apart_s), plot.valToPos(at_s, 'x'), plot.width - VALUES_PX) : '')) },
        { ...axis, size: VALUES_PX, space: 22, grid: { show: false }, splits: (plot, _axis, low, high, apart) => roomFor(valueTicks(low, high, apart, plot.height < LOW_PX), heightOf(plot)), values: (_, splits) => splits.map((value) => fixed(value, splits.some((one) => Math.abs(one % 1) > 1e-6 && Math.abs(one) < 100) ? 1 : 0)) },
      ],
      series: [{}, ...[0, 1].map(() => ({ stroke: palette.ink, width: 2, spanGaps: false, points: { show: false } }))],
      bands: [{ series: [2, 1], fill: palette.ink }],
      hooks: { drawAxes: [(plot) => this.#under(plot)], draw: [(plot) => this.#over(plot)] },
    }, [[], [], []], this.host);
  }

  /** @returns {[number, number]} */
  #ends() {
    const { answer, view, limits } = this.panes.sceneOf();
    const trend = answer?.signals[this.spec.name];
    const [low, high] = (answer && trend && extentOf(trend, answer, view)) ?? [0, 0];
    const [a, b] = this.spec.ends(limits, low, high).map((value) => shownIn(value, this.spec.unit).value);
    return a !== undefined && b !== undefined && b > a ? [a, b] : [0, 1];
  }

  /** Hatches what nobody knows. @param {uPlot} plot */
  #under(plot) {
    const { answer, unknown } = this.panes.sceneOf();
    const { ctx: g, bbox } = plot;
    const ratio = devicePixelRatio || 1;
    const bottom = bbox.top + bbox.height + (this.isLast ? 0 : bbox.top);
    const spans = [...unknown, ...(answer?.signals[this.spec.name]?.gaps ?? [])];
    g.save();
    g.beginPath();
    for (const [from_s, to_s] of spans) {
      const [a, b] = [this.#x(plot, from_s), this.#x(plot, to_s)].map((x) => Math.max(bbox.left, Math.min(bbox.left + bbox.width, x)));
      if (a !== undefined && b !== undefined && b > a) g.rect(a, 0, Math.max(b - a, 2 * ratio), bottom);
    }
    g.clip();
    g.setLineDash([]); // the grid left its own
    g.strokeStyle = this.panes.palette.hatch;
    g.lineWidth = 2.5 * ratio;
    g.beginPath();
    for (let x = bbox.left - bottom; x < bbox.left + bbox.width; x += 9 * ratio) {
      g.moveTo(x, bottom);
      g.lineTo(x + bottom, 0);
    }
    g.stroke();
    g.restore();
  }

  /** Draws zero, the limits over time, the marks and the cursor. @param {uPlot} plot */
  #over(plot) {
    const { answer, view, marks, cursor_s } = this.panes.sceneOf();
    const { palette } = this.panes;
    const { ctx: g, bbox } = plot;
    const ratio = devicePixelRatio || 1;
    const line = (/** @type {number[][]} */ points, /** @type {string} */ colour, /** @type {number[]} */ dash, width = 2) => {
      g.strokeStyle = colour;
      g.lineWidth = width * ratio;
      g.setLineDash(dash.map((one) => one * ratio));
      g.beginPath();
      for (const [x = 0, y = 0] of points) g.lineTo(x, y);
      g.stroke();
    };
    g.save();
    g.beginPath();
    g.rect(bbox.left, 0, bbox.width, plot.height * ratio);
    g.clip();
    const steps = answer?.signals[this.spec.name]?.limits ?? [];
    steps.forEach(([from_s, limit], i) => {
      const to_s = Math.min(steps[i + 1]?.[0] ?? Infinity, view[1]);
      const y = plot.valToPos(shownIn(limit, this.spec.unit).value, 'y', true);
      if (to_s > view[0]) line([[this.#x(plot, Math.max(from_s, view[0])), y], [this.#x(plot, to_s), y]], palette.you, [8, 5]);
    });
    const bottom = bbox.top + bbox.height + (this.isLast ? 0 : 40 * ratio);
    for (const { at_s, priority } of marks) line([[this.#x(plot, at_s), 0], [this.#x(plot, at_s), bottom]], priority === 'critical' ? palette.crit : palette.edge, [3, 4], 1.5);
    if (cursor_s !== null) line([[this.#x(plot, cursor_s), 0], [this.#x(plot, cursor_s), bottom]], palette.you, [], 2);
    g.restore();
  }

  /** @param {uPlot} plot @param {number} at_s */
  #x(plot, at_s) {
    return plot.valToPos((this.panes.sceneOf().answer?.start_ms ?? 0) / 1000 + at_s, 'x', true);
  }
}
