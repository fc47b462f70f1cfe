// Draws one sparkline of Home on its canvas.

import { SPAN, STEP_S } from './trends-layout.js';

const COLOURS = /** @type {const} */ (['panel', 'line', 'ink', 'ink2', 'edge', 'you', 'hatch', 'crit']);
const HEIGHT = 52;

/** @typedef {Record<typeof COLOURS[number], string>} Palette */

/**
 * Draws the last minute of a signal: its range, its limit, and hatching where nothing is known.
 * @param {HTMLCanvasElement} canvas
 * @param {import('./trends-layout.js').Spec} spec
 * @param {import('./trend-feed.js').Trends} trends
 * @param {import('../core/store.js').Store} store
 * @param {Palette} palette
 * @returns {[number, number] | null} the ends of the scale; null: nothing is drawn
 */
export function drawSpark(canvas, spec, trends, store, palette) {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight || HEIGHT;
  const dpr = window.devicePixelRatio || 1;
  const g = canvas.getContext('2d', { alpha: false });
  if (!width || !g) return null;
  const [w, h] = [Math.round(width * dpr), Math.round(height * dpr)];
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
  }
  g.setTransform(dpr, 0, 0, dpr, 0, 0);
  g.fillStyle = palette.panel;
  g.fillRect(0, 0, width, height);
  const { ink } = store.ink(spec.name);
  if (ink === 'not_published') return null;
  const course = trends.course(spec);
  const limits = store.frame?.limits ?? {};
  const [low, high] = spec.ends(limits, course.isEmpty ? 0 : course.low, course.isEmpty ? 0 : course.high);
  const x = (/** @type {number} */ at_s) => width * (1 + at_s / (SPAN * STEP_S));
  const y = (/** @type {number} */ value) => height - 4 - ((height - 8) * (value - low)) / (high - low || 1);
  hatch(g, course.gaps.map(([a, b]) => [x(a), Math.max(x(b) - x(a), 2)]), palette.hatch);
  line(g, palette.line, 1.5, [[0, y(Math.max(low, 0))], [width, y(Math.max(low, 0))]]);
  const limit = spec.limit === null ? null : store.limit(spec.limit);
  if (limit !== null && limit <= high) {
    g.setLineDash([6, 3]);
    line(g, palette.you, 1.5, [[0, y(limit)], [width, y(limit)]]);
    g.setLineDash([]);
  }
  g.strokeStyle = g.fillStyle = palette.ink;
  g.lineWidth = 2;
  g.lineJoin = 'round';
  g.beginPath();
  course.times_s.forEach((at_s, i) => {
    const [a, b] = [course.lowest[i] ?? null, course.highest[i] ?? null];
    if (a === null || b === null) return;
    if (i === 0 || course.lowest[i - 1] === null) g.moveTo(x(at_s), y(a));
    else g.lineTo(x(at_s), y(a));
    if (b !== a) g.lineTo(x(at_s), y(b));
    else if ((course.lowest[i - 1] ?? null) === null && (course.lowest[i + 1] ?? null) === null) g.rect(x(at_s) - 0.5, y(a) - 0.5, 1, 1); // a single point
  });
  g.stroke();
  return [low, high];
}

/** Draws diagonals where nothing is known. @param {CanvasRenderingContext2D} g @param {number[][]} bands x and width @param {string} colour */
function hatch(g, bands, colour) {
  if (!bands.length) return;
  g.save();
  g.beginPath();
  for (const [x = 0, width = 0] of bands) g.rect(x, 4, width, 44);
  g.clip();
  g.strokeStyle = colour;
  g.lineWidth = 2.5;
  g.beginPath();
  for (const [x = 0, width = 0] of bands) {
    for (let at = Math.floor((x - 44) / 9) * 9; at < x + width; at += 9) {
      g.moveTo(at, 48);
      g.lineTo(at + 44, 4);
    }
  }
  g.stroke();
  g.restore();
}

/** Draws a line through points. @param {CanvasRenderingContext2D} g @param {string} colour @param {number} width @param {number[][]} points */
function line(g, colour, width, points) {
  g.strokeStyle = colour;
  g.lineWidth = width;
  g.beginPath();
  for (const [x = 0, y = 0] of points) g.lineTo(x, y);
  g.stroke();
}

/** Returns the colours of the style sheet, for a canvas. @param {HTMLElement} root @returns {Palette} */
export function colours(root) {
  const probe = document.createElement('i');
  root.append(probe);
  const found = /** @type {any} */ ({});
  for (const name of COLOURS) {
    probe.style.color = `var(--${name})`;
    found[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return found;
}
