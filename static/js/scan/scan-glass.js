// The canvas of the scan: drawn by a thread of its own where the browser can, else by the page. Only the newest picture
// waits, and what is older is never drawn. Of a thread that answers no more the page takes over.

import { ScanPlot } from './scan-plot.js';
import { fontsOfStyles, themeAt } from './scan-theme.js';
import { PAINTER } from '../boot/trusted-types.js';

/** Pixels of the canvas for one of CSS: 20 pictures a second are carried to the glass, and finer than this nobody sees. */
const FINEST = 2;
/** A thread that has not drawn for so long gets half of it once more, for this page may itself have been asleep. */
const PATIENCE_MS = 1000;

/**
 * @typedef {import('./scan-plot.js').Around} Around
 * @typedef {import('./scan-frame.js').Scan} Scan
 * @typedef {{scan: Scan, at_ms: number, around: Around}} Wanted at_ms: when the scan came
 * @typedef {{age_s: number, at_ms: number}} Shown age of a scan when it came, and when that was
 */

export class ScanGlass {
  /** @type {Worker | null} */
  #painter = null;
  /** @type {ScanPlot | null} */
  #plot = null;
  /** @type {import('./scan-theme.js').Theme | null} */
  #theme = null;
  /** Width and height [CSS px]: read at each scan, they would force a layout of the whole page. */
  #size = { width: 0, height: 0 };
  /** Where `caption` covers the plot. @type {import('./scan-layout.js').Box | null} */
  #covered = null;
  #watcher = new ResizeObserver(() => this.#measure());
  /** The last request. @type {(() => Wanted | null) | null} */
  #newest = null;
  #isDue = false;
  /** What is being drawn. @type {Shown | null} */
  #drawing = null;
  #timer = 0;

  /** The scan that can be seen; null: none was drawn. @type {Shown | null} */
  shown = null;

  /** @param {HTMLCanvasElement} canvas @param {HTMLElement} caption which a wide screen has over it */
  constructor(canvas, caption) {
    this.canvas = canvas;
    this.caption = caption;
    this.#watcher.observe(canvas);
    this.#watcher.observe(caption);
    this.#begin();
  }

  /** Unmount. */
  stop() {
    this.#watcher.disconnect();
    this.#painter?.terminate();
    clearTimeout(this.#timer);
  }

  /** Another theme: requested with the next picture. */
  readTheme() {
    this.#theme = null;
  }

  /** Draws soon what is newest then. @param {() => Wanted | null} newest null: nothing any more */
  draw(newest) {
    this.#newest = newest;
    const wasDue = this.#isDue;
    this.#isDue = true;
    if (this.#painter) this.#post();
    else if (!wasDue) requestAnimationFrame(() => this.#drawHere());
  }

  #begin() {
    if (typeof Worker !== 'function' || !('transferControlToOffscreen' in this.canvas)) return;
    try {
      const painter = new Worker(PAINTER, { type: 'module' });
      painter.onmessage = () => this.#drawn();
      painter.onerror = () => this.#takeOver('it failed');
      const canvas = this.canvas.transferControlToOffscreen();
      painter.postMessage({ canvas }, [canvas]);
      this.#painter = painter;
      fontsOfStyles().then((fonts) => painter.postMessage({ fonts }, fonts.map(({ bytes }) => bytes)));
    } catch (error) {
      this.#takeOver(error);
    }
  }

  #post() {
    if (this.#drawing) return;
    const next = this.#next();
    if (!next) return;
    this.#drawing = next.shows;
    this.#timer = setTimeout(() => {
      this.#timer = setTimeout(() => this.#takeOver('it does not answer'), PATIENCE_MS / 2);
    }, PATIENCE_MS);
    this.#painter?.postMessage({ picture: next.picture });
  }

  #drawn() {
    if (!this.#painter) return; // reported before the page took over
    clearTimeout(this.#timer);
    this.shown = this.#drawing ?? this.shown;
    this.#drawing = null;
    this.#post();
  }

  #drawHere() {
    const next = this.#next();
    if (!next) return;
    this.#plot ??= new ScanPlot(this.canvas);
    this.#plot.draw(next.picture);
    this.shown = next.shows;
  }

  /** The thread has the canvas for good: the page draws on another. @param {unknown} why */
  #takeOver(why) {
    console.warn('The page now draws the scan itself, not a worker:', why);
    clearTimeout(this.#timer);
    this.#painter?.terminate();
    this.#painter = this.#drawing = null;
    const canvas = /** @type {HTMLCanvasElement} */ (this.canvas.cloneNode());
    this.canvas.replaceWith(canvas);
    this.#watcher.disconnect();
    this.#watcher.observe(canvas);
    this.#watcher.observe(this.caption);
    this.canvas = canvas;
    this.#isDue = this.#newest !== null;
    requestAnimationFrame(() => this.#drawHere());
  }

  #measure() {
    this.#size = { width: this.canvas.clientWidth, height: this.canvas.clientHeight };
    const [plot, { left, top, width, height }] = [this.canvas.getBoundingClientRect(), this.caption.getBoundingClientRect()];
    this.#covered = height && top < plot.bottom ? { left: left - plot.left, top: top - plot.top, width, height } : null;
  }

  /** What is to be drawn now; null: nothing, or there is no room. @returns {{picture: import('./scan-plot.js').Picture, shows: Shown} | null} */
  #next() {
    if (!this.#isDue || !this.#newest) return null;
    this.#isDue = false;
    if (!this.#size.width) this.#measure();
    const { width, height } = this.#size;
    const wanted = width && height ? this.#newest() : null;
    if (!wanted) return null;
    this.#theme ??= themeAt(this.canvas);
    const { scan, at_ms, around } = wanted;
    const dpr = Math.min(window.devicePixelRatio || 1, FINEST);
    return { picture: { scan, around, width, height, dpr, theme: this.#theme, caption: this.#covered }, shows: { age_s: scan.age_s, at_ms } };
  }
}
