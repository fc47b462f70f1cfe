// What stands still under the scan, drawn once a size and theme: the rings and spokes, and the pattern of the hatching.

import { plotScale, ringsOf } from './scan-layout.js';

const HATCH = { apart_px: 10, width_px: 2.5 };

/**
 * @typedef {HTMLCanvasElement | OffscreenCanvas} Surface
 * @typedef {CanvasRenderingContext2D | OffscreenCanvasRenderingContext2D} Pen
 */

export class ScanGrid {
  #canvas = surface(1, 1);
  #key = '';

  /**
   * Rings and spokes on the panel's colour, as a canvas.
   * @param {object} look
   * @param {number} look.width [CSS px]
   * @param {number} look.height [CSS px]
   * @param {number} look.dpr
   * @param {number} look.reach_m
   * @param {import('./scan-theme.js').Theme} look.theme
   */
  draw({ width, height, dpr, reach_m, theme }) {
    const key = `${width} ${height} ${dpr} ${reach_m} ${theme.key}`;
    if (key === this.#key) return this.#canvas;
    fit(this.#canvas, Math.round(width * dpr), Math.round(height * dpr));
    const g = penOf(this.#canvas);
    if (!g) return this.#canvas;
    this.#key = key;
    const { cx, cy, k, at } = plotScale(width, height, reach_m);
    g.setTransform(dpr, 0, 0, dpr, 0, 0);
    g.fillStyle = theme.colour.panel;
    g.fillRect(0, 0, width, height);
    g.strokeStyle = theme.colour.line;
    g.lineWidth = 1.5;
    g.beginPath();
    const rings = ringsOf(reach_m);
    for (const r of rings) {
      g.moveTo(cx - r * k, cy);
      g.arc(cx, cy, r * k, Math.PI, 0);
    }
    const inner = rings[0] ?? reach_m / 4;
    for (const degrees of [-90, -60, -30, 30, 60, 90]) {
      const a = (degrees * Math.PI) / 180;
      g.moveTo(...at(inner * Math.cos(a), inner * Math.sin(a)));
      g.lineTo(...at(reach_m * Math.cos(a), reach_m * Math.sin(a)));
    }
    g.stroke();
    return this.#canvas;
  }
}

export class Hatching {
  #key = '';
  /** @type {CanvasPattern | null} */
  #pattern = null;

  /** Diagonal lines as a pattern, made once a theme. @param {Pen} g @param {number} dpr @param {string} colour @param {string} look */
  of(g, dpr, colour, look) {
    const key = `${dpr} ${look}`;
    if (key === this.#key) return this.#pattern;
    const side = Math.round(HATCH.apart_px * dpr);
    const tile = surface(side, side);
    const t = penOf(tile);
    if (!t) return null;
    t.strokeStyle = colour;
    t.lineWidth = HATCH.width_px * dpr;
    t.beginPath();
    for (const shift of [-side, 0, side]) {
      t.moveTo(shift - side, side * 2);
      t.lineTo(shift + side * 2, -side);
    }
    t.stroke();
    this.#pattern = g.createPattern(tile, 'repeat');
    this.#pattern?.setTransform(new DOMMatrix().scale(1 / dpr));
    this.#key = key;
    return this.#pattern;
  }
}

/** Gives a canvas its size; it is cleared where that changes. @param {Surface} canvas @param {number} w @param {number} h [px] */
export function fit(canvas, w, h) {
  if (canvas.width === w && canvas.height === h) return;
  [canvas.width, canvas.height] = [w, h];
}

/** @param {Surface} canvas @param {CanvasRenderingContext2DSettings} [how] */
export function penOf(canvas, how) {
  return /** @type {Pen | null} */ (canvas.getContext('2d', how));
}

/** A canvas outside the page; a worker has no document. @param {number} width @param {number} height @returns {Surface} */
function surface(width, height) {
  if (typeof document === 'undefined') return new OffscreenCanvas(width, height);
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [width, height];
  return canvas;
}
