// Draws the signals of two recordings with uPlot's axes: A solid, B dotted, what either lacks hatched and named.

import uPlot from '../../vendor/uPlot.esm.js';
import { html, setText, setSentence } from '../core/dom.js';
import { duration, fixed, signed } from '../core/format.js';
import { shownIn } from '../core/units.js';
import { extentOf, foundAt, foundWords, valueTicks, wholeLabel } from '../home/drive-layout.js';
import { AXIS_PX, axisOf, BARE, INCRS_S, LOW_PX, PaneStack, plotSize } from '../home/pane-stack.js';
import { drawMarks, hatch } from './compare-draw.js';
import { courseOf, holesOf } from './compare-layout.js';

const VALUES_PX = 44;
const NAMES = /** @type {const} */ (['a', 'b']);

/**
 * @typedef {import('../home/trends-layout.js').Spec} Spec
 * @typedef {import('./compare-layout.js').Name} Name
 * @typedef {{answer: import('../home/drive-layout.js').Answer | null, begin_s: number, length_s: number}} SideScene
 *
 * @typedef {object} Scene what is drawn, on the time line of both
 * @property {import('../home/drive-layout.js').View} view
 * @property {number} cursor_s
 * @property {Record<Name, SideScene>} sides
 * @property {Record<string, number>} limits for the scales
 * @property {{at_s: number, side: Name, priority: string}[]} marks alarms in view
 */

/** @extends {PaneStack<Pane>} */
export class ComparePanes extends PaneStack {
  /** @param {HTMLElement} root @param {() => Scene | null} sceneOf */
  constructor(root, sceneOf) {
    super(root);
    this.sceneOf = sceneOf;
  }

  /** The colour of a warning, which no line has. */
  get amber() {
    return getComputedStyle(document.documentElement).getPropertyValue('--warn').trim();
  }

  /** @param {Spec[]} specs */
  build(specs) {
    this.stack(specs, (spec, isLast) => new Pane(spec, this, isLast));
  }

  draw() {
    for (const pane of this.panes) pane.draw();
  }
}

class Pane {
  /** @type {uPlot | null} */
  #plot = null;

  /** @param {Spec} spec @param {ComparePanes} panes @param {boolean} isLast */
  constructor(spec, panes, isLast) {
    this.spec = spec;
    this.panes = panes;
    this.isLast = isLast;
    this.values = { a: html('span', { class: 'n v' }), b: html('span', { class: 'n v' }) };
    this.apart = html('span', { class: 'n' });
    const unit = shownIn(0, spec.unit).unit;
    this.host = html('div', { class: 'cmp-plot' });
    this.element = html('div', { class: 'cmp-pane', 'data-signal': spec.name, ...(isLast ? { 'data-last': true } : {}) },
      html('div', { class: 'cmp-pane-head', title: spec.title }, html('span', { class: 'lab' }, `${spec.label}${unit ? `, ${unit}` : ''}`),
        html('span', {}, html('b', {}, 'A '), this.values.a), html('span', { class: 'sub' }, html('b', {}, 'B '), this.values.b), html('span', { class: 'sub small' }, this.apart)), this.host);
  }

  get plot() {
    return /** @type {uPlot} */ (this.#plot); // since it has begun
  }

  begin() {
    this.#plot = this.#build();
  }

  resize() {
    this.plot.setSize(plotSize(this.host));
  }

  draw() {
    this.#write();
    this.plot.redraw(true, true);
  }

  /** What stands at the cursor of both, and how far they are apart. */
  #write() {
    const scene = this.panes.sceneOf();
    if (!scene) return;
    const numbers = NAMES.map((name) => {
      const { answer, begin_s } = scene.sides[name];
      const trend = answer?.signals[this.spec.name];
      const own_s = scene.cursor_s - begin_s;
      const hole = holesOf(answer, this.spec.name, begin_s, scene.sides[name].length_s).find(({ from_s, to_s }) => scene.cursor_s > from_s && scene.cursor_s < to_s);
      const found = answer && trend && !hole ? foundAt(trend, answer, own_s) : null;
      setSentence(this.values[name], hole ? hole.why : found ? foundWords(found, this.spec) : '–');
      this.values[name].toggleAttribute('data-words', hole !== undefined || (found !== null && found.kind !== 'value'));
      return found?.kind === 'value' ? (found.low + found.high) / 2 : null;
    });
    const [a = null, b = null] = numbers;
    setText(this.apart, a === null || b === null ? '' : `B − A ${signed(shownIn(b - a, this.spec.unit).value, this.spec.digits)}`);
  }

  #build() {
    const { palette } = this.panes;
    const axis = axisOf(palette);
    return new uPlot({
      ...plotSize(this.host),
      padding: [12, 12, this.isLast ? 0 : 8, 0],
      ...BARE,
      scales: { x: { time: false, range: () => this.panes.sceneOf()?.view ?? [0, 1] }, y: { range: () => this.#ends() } },
      axes: [
        { ...axis, size: this.isLast ? AXIS_PX : 0, space: 64, incrs: INCRS_S, values: (plot, splits) => splits.map((at_s) => (this.isLast ? wholeLabel(`${at_s < 0 ? '−' : ''}${duration(Math.abs(at_s))}`, plot.valToPos(at_s, 'x'), plot.width - VALUES_PX) : '')) },
        { ...axis, size: VALUES_PX, space: 22, grid: { show: false }, splits: (_, _axis, low, high, apart) => valueTicks(low, high, apart, plotSize(this.host).height < LOW_PX), values: (_, splits) => splits.map((value) => fixed(value, splits.some((one) => Math.abs(one % 1) > 1e-6 && Math.abs(one) < 100) ? 1 : 0)) },
      ],
      series: [{}, { show: true, stroke: palette.ink, points: { show: false } }],
      hooks: { drawAxes: [(plot) => this.#under(plot)], draw: [(plot) => this.#over(plot)] },
    }, [[0, 1], [null, null]], this.host);
  }

  /** @returns {[number, number]} */
  #ends() {
    const scene = this.panes.sceneOf();
    if (!scene) return [0, 1];
    const found = NAMES.flatMap((name) => {
      const { answer, begin_s } = scene.sides[name];
      const trend = answer?.signals[this.spec.name];
      return (answer && trend && extentOf(trend, answer, [scene.view[0] - begin_s, scene.view[1] - begin_s])) ?? [];
    });
    const [low, high] = found.length ? [Math.min(...found), Math.max(...found)] : [0, 0];
    const [a, b] = this.spec.ends(scene.limits, low, high).map((value) => shownIn(value, this.spec.unit).value);
    return a !== undefined && b !== undefined && b > a ? [a, b] : [0, 1];
  }

  /** Hatches what a side lacks. @param {uPlot} plot */
  #under(plot) {
    for (const { box, i } of this.#holes(plot)) hatch(plot.ctx, box, this.panes.palette.hatch, i ? 1 : -1, devicePixelRatio || 1);
  }

  /** Names what a side lacks, over the lines. @param {uPlot} plot */
  #nameHoles(plot) {
    const { ctx: g } = plot;
    const ratio = devicePixelRatio || 1;
    g.setLineDash([]);
    g.font = `${13 * ratio}px ${getComputedStyle(this.host).fontFamily}`;
    g.textAlign = 'left';
    g.textBaseline = 'middle';
    for (const { box: [left, top, width, height], text } of this.#holes(plot)) {
      const shown = [text, text.slice(0, 1)].find((one) => g.measureText(one).width + 12 * ratio <= width);
      if (shown === undefined) continue;
      const long = g.measureText(shown).width;
      g.fillStyle = this.panes.palette.panel;
      g.fillRect(left + 4 * ratio, top + height / 2 - 9 * ratio, long + 8 * ratio, 18 * ratio);
      g.fillStyle = this.panes.palette.ink;
      g.fillText(shown, left + 8 * ratio, top + height / 2);
    }
  }

  /** What A lacks in the upper half, what B lacks in the lower. @param {uPlot} plot @returns {{box: [number, number, number, number], i: number, text: string}[]} */
  #holes(plot) {
    const scene = this.panes.sceneOf();
    const { bbox } = plot;
    const ratio = devicePixelRatio || 1;
    /** @type {{box: [number, number, number, number], i: number, text: string}[]} */
    const found = [];
    if (!scene) return found;
    for (const [i, name] of NAMES.entries()) {
      const { answer, begin_s, length_s } = scene.sides[name];
      const [top, height] = [bbox.top + (i * bbox.height) / 2, bbox.height / 2];
      for (const { from_s, to_s, why } of holesOf(answer, this.spec.name, begin_s, length_s)) {
        const [a, b] = [this.#x(plot, Math.max(from_s, scene.view[0])), this.#x(plot, Math.min(to_s, scene.view[1]))];
        if (!(b > a)) continue;
        found.push({ box: [a, top, Math.max(b - a, 2 * ratio), height], i, text: `${name.toUpperCase()}: ${why}` });
      }
    }
    return found;
  }

  /** Draws both lines, the limits and the cursor. @param {uPlot} plot */
  #over(plot) {
    const scene = this.panes.sceneOf();
    if (!scene) return;
    const { ctx: g, bbox } = plot;
    const { palette } = this.panes;
    const ratio = devicePixelRatio || 1;
    g.save();
    g.beginPath();
    g.rect(bbox.left, 0, bbox.width, plot.height * ratio);
    g.clip();
    g.lineJoin = 'round';
    for (const name of /** @type {const} */ (['b', 'a'])) this.#line(plot, scene.sides[name], name);
    this.#limits(plot, scene);
    drawMarks(plot, scene.marks, { ...palette, amber: this.panes.amber }, this.panes.panes[0] === this);
    this.#nameHoles(plot);
    g.strokeStyle = palette.you;
    g.lineWidth = 3 * ratio;
    g.setLineDash([]);
    g.beginPath();
    const x = this.#x(plot, scene.cursor_s);
    g.moveTo(x, 0);
    g.lineTo(x, bbox.top + bbox.height + (this.isLast ? 0 : 40 * ratio));
    g.stroke();
    g.restore();
  }

  /** Lowest and highest of each bucket: A solid and filled between, B dotted. @param {uPlot} plot @param {SideScene} side @param {Name} name */
  #line(plot, { answer, begin_s }, name) {
    const { ctx: g } = plot;
    const { palette } = this.panes;
    const ratio = devicePixelRatio || 1;
    const { times_s, lowest, highest } = courseOf(answer, this.spec.name, begin_s);
    const y = (/** @type {number} */ value) => plot.valToPos(shownIn(value, this.spec.unit).value, 'y', true);
    g.strokeStyle = g.fillStyle = name === 'a' ? palette.ink : palette.ink2;
    g.lineWidth = (name === 'a' ? 2.5 : 2) * ratio;
    g.setLineDash(name === 'a' ? [] : [2 * ratio, 4 * ratio]);
    for (const values of [lowest, highest]) {
      g.beginPath();
      let isCut = true;
      values.forEach((value, i) => {
        if (value === null) isCut = true;
        else if (isCut) g.moveTo(this.#x(plot, times_s[i] ?? 0), y(value));
        else g.lineTo(this.#x(plot, times_s[i] ?? 0), y(value));
        if (value !== null) isCut = false;
      });
      g.stroke();
    }
    if (name === 'b') return;
    g.beginPath();
    lowest.forEach((low, i) => {
      const high = highest[i] ?? null;
      if (low === null || high === null || low === high) return;
      g.moveTo(this.#x(plot, times_s[i] ?? 0), y(low));
      g.lineTo(this.#x(plot, times_s[i] ?? 0), y(high));
    });
    g.stroke();
  }

  /** The limits of A, and those of B where they are others. @param {uPlot} plot @param {Scene} scene */
  #limits(plot, scene) {
    const { ctx: g, bbox } = plot;
    const ratio = devicePixelRatio || 1;
    const { palette } = this.panes;
    const drawn = new Set();
    for (const name of NAMES) {
      const { answer, begin_s, length_s } = scene.sides[name];
      const steps = answer?.signals[this.spec.name]?.limits ?? [];
      steps.forEach(([from_s, limit], i) => {
        const [a, b] = [Math.max(begin_s + from_s, scene.view[0]), Math.min(begin_s + (steps[i + 1]?.[0] ?? length_s), scene.view[1])];
        if (!(b > a)) return;
        const y = plot.valToPos(shownIn(limit, this.spec.unit).value, 'y', true);
        g.strokeStyle = palette.you;
        g.lineWidth = 2 * ratio;
        g.setLineDash([7 * ratio, 4 * ratio]);
        g.beginPath();
        g.moveTo(this.#x(plot, a), y);
        g.lineTo(this.#x(plot, b), y);
        g.stroke();
        if (drawn.has(limit)) return;
        drawn.add(limit);
        const label = `${name === 'b' ? 'B ' : ''}limit ${fixed(shownIn(limit, this.spec.unit).value, this.spec.digits)}`;
        g.font = `700 ${13 * ratio}px ${getComputedStyle(this.host).fontFamily}`;
        g.textAlign = 'right';
        g.textBaseline = y - bbox.top < 18 * ratio ? 'top' : 'bottom';
        const at = [this.#x(plot, b) - 4 * ratio, y + (g.textBaseline === 'top' ? 3 : -3) * ratio];
        g.setLineDash([]);
        g.lineWidth = 4 * ratio;
        g.strokeStyle = palette.panel;
        g.strokeText(label, at[0] ?? 0, at[1] ?? 0);
        g.fillStyle = palette.you;
        g.fillText(label, at[0] ?? 0, at[1] ?? 0);
      });
    }
  }

  /** @param {uPlot} plot @param {number} at_s */
  #x(plot, at_s) {
    return plot.valToPos(at_s, 'x', true);
  }
}
