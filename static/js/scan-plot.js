// Draws the scan from above on a canvas. What stands still is drawn once and kept; a scan adds hatching and points.

import { CORRIDOR_M, codeWords, namedSectors, nearestInCorridor, plotScale, pointsOf, ringsOf, sectorsOf } from './scan-layout.js';
import { fixed } from './words.js';

const COLOURS = /** @type {const} */ (['panel', 'line', 'ink', 'ink2', 'you', 'hatch', 'raise']);
const NAMES_SHOWN = 4;

/**
 * @typedef {object} Around what is drawn beside the scan
 * @property {number} reach_m
 * @property {number | null} stopping_m
 * @property {number | null} limit_m
 */

export class ScanPlot {
  #ground = document.createElement('canvas');
  #groundKey = '';
  /** @type {Record<typeof COLOURS[number], string>} */
  #colour = /** @type {any} */ ({});
  #font = '';

  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.readTheme();
  }

  /** Colours and font as the style sheet has them now. */
  readTheme() {
    const style = getComputedStyle(document.documentElement);
    const probe = document.createElement('i');
    this.canvas.after(probe);
    for (const name of COLOURS) {
      probe.className = `probe ${name}`;
      this.#colour[name] = getComputedStyle(probe).color;
    }
    probe.remove();
    this.#font = style.getPropertyValue('--digits').trim() || 'sans-serif';
    this.#groundKey = '';
  }

  /**
   * @param {import('./scan-frame.js').Scan} scan
   * @param {Around} around
   */
  draw(scan, around) {
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    const dpr = window.devicePixelRatio || 1;
    if (!width || !height) return;
    for (const canvas of [this.canvas, this.#ground]) {
      const [w, h] = [Math.round(width * dpr), Math.round(height * dpr)];
      if (canvas.width !== w || canvas.height !== h) {
        canvas.width = w;
        canvas.height = h;
        this.#groundKey = '';
      }
    }
    const g = this.canvas.getContext('2d');
    if (!g) return;
    this.#drawGround(width, height, dpr, around);
    g.setTransform(1, 0, 0, 1, 0, 0);
    g.drawImage(this.#ground, 0, 0);
    g.setTransform(dpr, 0, 0, dpr, 0, 0);
    const scale = plotScale(width, height, around.reach_m);
    const sectors = sectorsOf(scan);
    this.#hatch(g, scale, sectors, width, height);
    this.#corridor(g, scale, around);
    this.#rings(g, scale, around.reach_m);
    this.#names(g, scale, around.reach_m, sectors, width);
    this.#points(g, scale, pointsOf(scan, around.reach_m * 1.05));
    this.#nearest(g, scale, nearestInCorridor(scan), around.reach_m);
    this.#car(g, scale, height);
  }

  /** Rings and spokes. @param {number} width @param {number} height @param {number} dpr @param {Around} around */
  #drawGround(width, height, dpr, { reach_m }) {
    const key = `${width} ${height} ${dpr} ${reach_m}`;
    if (key === this.#groundKey) return;
    this.#groundKey = key;
    const g = this.#ground.getContext('2d');
    if (!g) return;
    const { cx, cy, k, at } = plotScale(width, height, reach_m);
    g.setTransform(dpr, 0, 0, dpr, 0, 0);
    g.fillStyle = this.#colour.panel;
    g.fillRect(0, 0, width, height);
    g.strokeStyle = this.#colour.line;
    g.lineWidth = 1.5;
    g.beginPath();
    for (const r of ringsOf(reach_m)) {
      g.moveTo(cx - r * k, cy);
      g.arc(cx, cy, r * k, Math.PI, 0);
    }
    for (const degrees of [-90, -60, -30, 30, 60, 90]) {
      const a = (degrees * Math.PI) / 180;
      g.moveTo(...at((reach_m / 4) * Math.cos(a), (reach_m / 4) * Math.sin(a)));
      g.lineTo(...at(reach_m * Math.cos(a), reach_m * Math.sin(a)));
    }
    g.stroke();
  }

  /** @param {CanvasRenderingContext2D} g @param {ReturnType<typeof plotScale>} scale @param {import('./scan-layout.js').Sector[]} sectors @param {number} width @param {number} height */
  #hatch(g, { cx, cy }, sectors, width, height) {
    if (!sectors.length) return;
    const far = width + height;
    g.save();
    g.beginPath();
    for (const { from_rad, to_rad } of sectors) {
      g.moveTo(cx, cy);
      g.arc(cx, cy, far, -Math.PI / 2 - to_rad, -Math.PI / 2 - from_rad);
      g.closePath();
    }
    g.clip();
    g.fillStyle = this.#colour.panel;
    g.fillRect(0, 0, width, height);
    g.strokeStyle = this.#colour.hatch;
    g.lineWidth = 2.5;
    g.beginPath();
    for (let x = -height; x < width + height; x += 10) {
      g.moveTo(x, height);
      g.lineTo(x + height, 0);
    }
    g.stroke();
    g.restore();
  }

  /** @param {CanvasRenderingContext2D} g @param {ReturnType<typeof plotScale>} scale @param {Around} around */
  #corridor(g, { cy, k, at }, { stopping_m, limit_m }) {
    const colour = this.#colour;
    const [left] = at(0, CORRIDOR_M);
    const [right] = at(0, -CORRIDOR_M);
    const stop = Math.max(8, cy - (stopping_m ?? 0) * k);
    g.fillStyle = colour.raise;
    g.fillRect(left, stop, right - left, cy - stop);
    g.strokeStyle = colour.ink2;
    g.lineWidth = 2;
    g.setLineDash([7, 5]);
    g.beginPath();
    for (const x of [left, right]) {
      g.moveTo(x, stop);
      g.lineTo(x, 8);
    }
    g.stroke();
    g.setLineDash([]);
    g.beginPath();
    for (const x of [left, right]) {
      g.moveTo(x, cy);
      g.lineTo(x, stop);
    }
    g.stroke();
    if (stopping_m !== null && stopping_m > 0) {
      g.strokeStyle = colour.ink;
      g.lineWidth = 5;
      g.beginPath();
      g.moveTo(left - 5, stop);
      g.lineTo(right + 5, stop);
      g.stroke();
      this.#words(g, `stop ${fixed(stopping_m)} m`, left - 12, stop, colour.ink, 'right');
    }
    if (limit_m !== null) {
      const y = cy - limit_m * k;
      g.strokeStyle = colour.you;
      g.lineWidth = 3;
      g.beginPath();
      g.moveTo(left, y);
      g.lineTo(right, y);
      g.stroke();
      this.#words(g, `limit ${fixed(limit_m)} m`, right + 12, y, colour.you, 'left', 14, 700);
    }
  }

  /** @param {CanvasRenderingContext2D} g @param {ReturnType<typeof plotScale>} scale @param {number} reach_m */
  #rings(g, { at }, reach_m) {
    const a = (19 * Math.PI) / 180;
    for (const r of ringsOf(reach_m)) this.#words(g, String(r), ...at(r * Math.cos(a), r * Math.sin(a)), this.#colour.ink2, 'center');
  }

  /** @param {CanvasRenderingContext2D} g @param {ReturnType<typeof plotScale>} scale @param {number} reach_m @param {import('./scan-layout.js').Sector[]} sectors @param {number} width */
  #names(g, { cx, k, at }, reach_m, sectors, width) {
    for (const sector of namedSectors(sectors, NAMES_SHOWN)) {
      const a = (sector.from_rad + sector.to_rad) / 2;
      const aside = Math.abs(Math.sin(a));
      // As far out as the edge allows, so that the word stands where its sector is wide.
      const r = Math.min(reach_m * 0.36, aside > 0.05 ? (cx - 44) / (k * aside) : reach_m);
      const [x, y] = at(r * Math.cos(a), r * Math.sin(a));
      this.#words(g, codeWords(sector.code), Math.min(width - 42, Math.max(42, x)), y, this.#colour.ink, 'center', 14, 700);
    }
  }

  /** @param {CanvasRenderingContext2D} g @param {ReturnType<typeof plotScale>} scale @param {Float32Array} points */
  #points(g, { cx, cy, k }, points) {
    g.fillStyle = this.#colour.ink;
    g.beginPath();
    for (let i = 0; i < points.length; i += 2) g.rect(cx - (points[i + 1] ?? 0) * k - 2.5, cy - (points[i] ?? 0) * k - 2.5, 5, 5);
    g.fill();
  }

  /** @param {CanvasRenderingContext2D} g @param {ReturnType<typeof plotScale>} scale @param {{range_m: number, bearing_rad: number} | null} nearest @param {number} reach_m */
  #nearest(g, { at }, nearest, reach_m) {
    if (!nearest || nearest.range_m > reach_m) return;
    const [x, y] = at(nearest.range_m * Math.cos(nearest.bearing_rad), nearest.range_m * Math.sin(nearest.bearing_rad));
    g.strokeStyle = this.#colour.ink;
    g.lineWidth = 3;
    g.beginPath();
    g.arc(x, y, 15, 0, 7);
    g.moveTo(x + 15, y);
    g.lineTo(x + 36, y);
    g.stroke();
    this.#words(g, `${fixed(nearest.range_m)} m`, x + 44, y - 1, this.#colour.ink, 'left', 22, 700);
  }

  /** The car, its nose at the laser. @param {CanvasRenderingContext2D} g @param {ReturnType<typeof plotScale>} scale @param {number} height */
  #car(g, { cx, cy, k }, height) {
    const half = Math.min(60, Math.max(7, 0.9 * k));
    g.strokeStyle = this.#colour.ink;
    g.fillStyle = this.#colour.panel;
    g.lineWidth = 2.5;
    g.lineJoin = 'round';
    g.beginPath();
    g.moveTo(cx - half * 0.7, cy);
    g.lineTo(cx + half * 0.7, cy);
    g.lineTo(cx + half, cy + 12);
    g.lineTo(cx + half, height + 4);
    g.lineTo(cx - half, height + 4);
    g.lineTo(cx - half, cy + 12);
    g.closePath();
    g.fill();
    g.stroke();
    g.beginPath();
    g.moveTo(cx - half, cy + 22);
    g.lineTo(cx + half, cy + 22);
    g.stroke();
  }

  /** Words on a plate of the panel's colour. @param {CanvasRenderingContext2D} g @param {string} text @param {number} x @param {number} y @param {string} css @param {CanvasTextAlign} [align] @param {number} [size] @param {number} [weight] */
  #words(g, text, x, y, css, align = 'left', size = 14, weight = 400) {
    g.font = `${weight} ${size}px ${this.#font}`;
    g.textAlign = align;
    g.textBaseline = 'middle';
    const width = g.measureText(text).width + 8;
    const left = align === 'left' ? x - 4 : align === 'right' ? x - width + 4 : x - width / 2;
    g.fillStyle = this.#colour.panel;
    g.fillRect(left, y - size * 0.72, width, size * 1.44);
    g.fillStyle = css;
    g.fillText(text, x, y);
  }
}
