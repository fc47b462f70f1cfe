// The last minute of a limit's signal against the limit in force, in the row of the limit: drawn while it is in sight.

import { html, listen, setAttribute } from '../core/dom.js';
import { colours, drawSpark } from '../home/spark.js';
import { trendsOf } from '../home/trend-feed.js';

const DRAW_EVERY_MS = 400;

/** A trace; `draw` is called as often as the page draws. */
export class SettingsTrace {
  #isSeen = false;
  #drew_ms = -Infinity;
  /** @type {import('../home/spark.js').Palette | null} */
  #palette = null;

  /** @param {import('../core/store.js').Store} store @param {import('../home/trends-layout.js').Spec} spec whose limit it is */
  constructor(store, spec) {
    this.store = store;
    this.spec = spec;
    this.trends = trendsOf(store);
    this.canvas = /** @type {HTMLCanvasElement} */ (html('canvas', { class: 'spark' }));
    this.element = html('div', { class: 'trace', role: 'img', 'aria-label': `${spec.title}, the last minute against this limit` }, html('span', { class: 'lab' }, 'last ', html('span', { class: 'n' }, '60'), ' s'), this.canvas);
    const watcher = new IntersectionObserver((entries) => {
      this.#isSeen = entries.at(-1)?.isIntersecting ?? false;
      this.redraw();
    });
    watcher.observe(this.canvas);
    const anew = () => this.redraw();
    this.stops = [
      () => watcher.disconnect(),
      listen(window, 'catgraph-theme', anew),
      listen(matchMedia('(prefers-color-scheme: light)'), 'change', anew),
      listen(window, 'resize', anew),
    ];
  }

  redraw() {
    this.#palette = null;
    this.#drew_ms = -Infinity;
    this.draw();
  }

  draw() {
    const { store } = this;
    if (!this.#isSeen || document.hidden || store.now() - this.#drew_ms < DRAW_EVERY_MS) return;
    this.#drew_ms = store.now();
    this.#palette ??= colours(this.element);
    const ends = drawSpark(this.canvas, this.spec, this.trends, store, this.#palette);
    setAttribute(this.element, 'data-drawn', ends !== null);
  }

  stop() {
    for (const stop of this.stops) stop();
  }
}
