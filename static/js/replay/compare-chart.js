// The chart of two recordings: the chosen signals that either has, built anew when their names, the theme or the unit change.

import { listen, setSentence } from '../core/dom.js';
import { counted } from '../core/format.js';
import { chosenSignals } from '../home/drive-choice.js';
import { specFor } from '../home/drive-layout.js';
import { ComparePanes } from './compare-panes.js';

export class CompareChart {
  /** By which the panes were built. */
  #built = '';
  #drawn = '';

  /**
   * @param {ReturnType<typeof import('./compare-parts.js').build>} parts
   * @param {Record<'a' | 'b', import('./compare-feed.js').SideFeed>} feeds
   * @param {import('../core/store.js').Store} store
   * @param {() => import('./compare-panes.js').Scene | null} sceneOf
   */
  constructor(parts, feeds, store, sceneOf) {
    this.parts = parts;
    this.feeds = feeds;
    this.store = store;
    this.panes = new ComparePanes(parts.plots, sceneOf);
    const anew = () => this.#rebuild();
    const resize = new ResizeObserver(() => {
      this.panes.resize();
      this.#drawn = '';
    });
    resize.observe(parts.plots);
    this.stops = [
      () => resize.disconnect(),
      listen(window, 'catgraph-trends', anew),
      listen(window, 'catgraph-theme', anew),
      listen(window, 'catgraph-units', anew),
      listen(matchMedia('(prefers-color-scheme: light)'), 'change', anew),
    ];
    this.#rebuild();
  }

  unmount() {
    for (const stop of this.stops) stop();
    this.panes.clear();
  }

  /** New numbers came. */
  filled() {
    if (this.#kinds() !== this.#built) this.#rebuild();
    this.#drawn = '';
  }

  /** @param {string} picture what of it may have changed */
  draw(picture) {
    if (picture === this.#drawn) return;
    this.#drawn = picture;
    this.panes.draw();
  }

  #rebuild() {
    const { a, b } = this.feeds;
    const names = chosenSignals();
    const lacking = names.filter((name) => a.lacks(name) && b.lacks(name));
    const specs = names.map((name) => specFor(name, a.answer?.offered[name] ?? b.answer?.offered[name] ?? this.store.signal(name)));
    this.#built = this.#kinds();
    this.panes.build(specs.filter(({ name }) => !lacking.includes(name)));
    setSentence(this.parts.count, counted(names.length, 'signal'));
    setSentence(this.parts.none, lacking.length ? `Recorded in neither: ${specs.filter(({ name }) => lacking.includes(name)).map(({ label }) => label).join(', ')}` : '');
    this.#drawn = '';
  }

  #kinds() {
    const { a, b } = this.feeds;
    return chosenSignals().map((name) => `${name} ${a.answer?.offered[name]?.label ?? b.answer?.offered[name]?.label} ${a.lacks(name) && b.lacks(name)}`).join();
  }
}
