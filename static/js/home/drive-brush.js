// The whole drive as a strip below its chart: the first signal, gaps and alarms, and the window that the chart shows.

import { html, listen, setAttribute, setText, svg } from '../core/dom.js';
import { duration } from '../core/format.js';
import { brushPath, placedMarks } from './drive-layout.js';

const HEIGHT = 52;
const EDGE_PX = 22; // a finger this near to an edge of the window moves the edge
const ICONS = { critical: 'M-4-8h8l4 4v8l-4 4h-8l-4-4v-8z', warning: 'M0-8 9 8H-9z' };

/**
 * @typedef {import('./drive-layout.js').View} View
 * @typedef {import('./drive-layout.js').Answer} Answer
 */

export class Brush {
  #width = 1;
  #length_s = 1;
  /** @type {View} */
  #view = [0, 1];
  /** @type {{part: 'from' | 'to' | 'all', at_s: number, view: View} | null} */
  #grip = null;

  /** @param {(view: View) => void} onView */
  constructor(onView) {
    this.onView = onView;
    this.length = html('span', { class: 'n' });
    this.gaps = svg('g', { class: 'gaps' });
    this.line = svg('path', { class: 'line' });
    this.marks = svg('g', { class: 'marks' });
    this.window = svg('rect', { class: 'window', y: 1.5, height: HEIGHT - 3 });
    this.grips = [svg('rect', { class: 'grip', y: 14, width: 12, height: 24 }), svg('rect', { class: 'grip', y: 14, width: 12, height: 24 })];
    this.picture = svg('svg', { height: HEIGHT, 'aria-hidden': 'true' }, this.gaps, this.line, this.marks, this.window, ...this.grips);
    this.host = html('div', { class: 'trends-strip' }, this.picture);
    this.element = html('div', { class: 'trends-brush' }, html('div', { class: 'trends-head' }, html('span', { class: 'lab' }, 'Drive'), this.length), this.host);
    this.stops = [
      listen(this.host, 'pointerdown', (event) => this.#down(event)),
      listen(this.host, 'pointermove', (event) => this.#move(event)),
      ...['pointerup', 'pointercancel'].map((type) => listen(this.host, type, () => { this.#grip = null; })),
    ];
  }

  unmount() {
    for (const stop of this.stops) stop();
  }

  /** It has another width: to look with each answer would make the browser do its layout at once. */
  resize() {
    this.#width = Math.max(1, this.host.clientWidth);
  }

  /** The drive itself. @param {Answer} overview @param {string} signal */
  fill(overview, signal) {
    this.#length_s = Math.max(1, overview.length_s);
    const trend = overview.signals[signal];
    setText(this.length, duration(overview.length_s, true));
    setAttribute(this.line, 'd', trend ? brushPath(trend, overview, this.#length_s, this.#width, 12, HEIGHT - 8) : '');
    this.gaps.replaceChildren(...[...overview.blind, ...(trend?.gaps ?? [])].map(([from_s, to_s]) => svg('rect', { x: this.#x(from_s).toFixed(1), width: Math.max(2, this.#x(to_s) - this.#x(from_s)).toFixed(1), y: 3, height: HEIGHT - 6 })));
    this.marks.replaceChildren(...placedMarks(overview.marks, [0, this.#length_s], this.#width).map(({ x, priority }) => svg('path', { d: ICONS[priority], transform: `translate(${x.toFixed(1)} 15)`, class: priority })));
  }

  /** The window. @param {View} view @param {number} end_s */
  draw(view, end_s) {
    this.#view = view;
    this.#length_s = Math.max(1, end_s);
    const from = Math.max(0, this.#x(view[0]));
    const to = Math.max(from + 4, Math.min(this.#width, this.#x(view[1])));
    setAttribute(this.window, 'x', (from + 1.5).toFixed(1));
    setAttribute(this.window, 'width', Math.max(1, to - from - 3).toFixed(1));
    setAttribute(/** @type {Element} */ (this.grips[0]), 'x', (from - 5).toFixed(1));
    setAttribute(/** @type {Element} */ (this.grips[1]), 'x', (to - 7).toFixed(1));
  }

  /** @param {number} at_s */
  #x(at_s) {
    return (at_s / this.#length_s) * this.#width;
  }

  /** @param {PointerEvent} event */
  #at(event) {
    return ((event.clientX - this.host.getBoundingClientRect().left) / this.#width) * this.#length_s;
  }

  /** @param {PointerEvent} event */
  #down(event) {
    const at_s = this.#at(event);
    const near_s = (EDGE_PX / this.#width) * this.#length_s;
    let [from_s, to_s] = this.#view;
    const isWide = to_s - from_s > 2 * near_s;
    /** @type {'from' | 'to' | 'all'} */
    let part = 'all';
    if (isWide && Math.abs(at_s - from_s) < near_s) part = 'from';
    else if (isWide && Math.abs(at_s - to_s) < near_s) part = 'to';
    else if (at_s < from_s - near_s || at_s > to_s + near_s) {
      [from_s, to_s] = [at_s - (to_s - from_s) / 2, at_s + (to_s - from_s) / 2];
      this.onView([from_s, to_s]);
    }
    this.#grip = { part, at_s, view: [from_s, to_s] };
    this.host.setPointerCapture(event.pointerId);
  }

  /** @param {PointerEvent} event */
  #move(event) {
    if (!this.#grip) return;
    const { part, at_s, view: [from_s, to_s] } = this.#grip;
    const by_s = this.#at(event) - at_s;
    this.onView([part === 'to' ? from_s : from_s + by_s, part === 'from' ? to_s : to_s + by_s]);
  }
}
