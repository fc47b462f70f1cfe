// Draws the last minute of one check on a canvas: what it measured, its limit, hatched where it was not checked.

import { endsOf, gapsOf } from './check-layout.js';
import { shownIn } from '../core/units.js';
import { fixed, timeOfDay } from '../core/format.js';

const STEPS = 300; // a minute
const PAD = { left: 44, right: 2, top: 6, bottom: 22 };

/**
 * @param {HTMLCanvasElement} canvas
 * @param {import('../core/protocol-types.js').CheckMinuteState} minute
 * @param {string} unit of the wire
 * @param {number} now_ms
 * @param {Record<string, string>} palette
 */
export function drawMinute(canvas, minute, unit, now_ms, palette) {
  const { clientWidth: width, clientHeight: height } = canvas;
  const g = canvas.getContext('2d');
  if (!width || !height || !g) return;
  const dpr = window.devicePixelRatio || 1;
  const [w, h] = [Math.round(width * dpr), Math.round(height * dpr)];
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  g.setTransform(dpr, 0, 0, dpr, 0, 0);
  g.clearRect(0, 0, width, height);
  const colour = (/** @type {string} */ name) => palette[name] ?? '';
  const face = getComputedStyle(canvas).getPropertyValue('--digits').trim();
  const shown = (/** @type {number | null} */ value) => (value === null ? null : shownIn(value, unit).value);
  const values = padded(minute.values.map(shown));
  const limits = padded(minute.limits.map(shown));
  const [low, high] = endsOf(values, limits);
  const x = (/** @type {number} */ step) => PAD.left + ((width - PAD.left - PAD.right) * step) / STEPS;
  const y = (/** @type {number} */ value) => height - PAD.bottom - ((height - PAD.top - PAD.bottom) * (value - low)) / (high - low);
  hatch(g, gapsOf(values).map(([from, to]) => [x(from), x(to)]), [PAD.top, height - PAD.bottom], colour('hatch'));
  g.lineWidth = 1.5;
  g.strokeStyle = colour('line');
  path(g, [[PAD.left, PAD.top], [PAD.left, height - PAD.bottom], [width - PAD.right, height - PAD.bottom]]);
  g.fillStyle = colour('ink2');
  g.font = `13px ${face}`;
  g.textBaseline = 'middle';
  g.textAlign = 'right';
  const digits = high - low < 5 ? 1 : 0;
  g.fillText(fixed(high, digits), PAD.left - 6, PAD.top + 6);
  g.fillText(fixed(low, digits), PAD.left - 6, height - PAD.bottom - 4);
  g.textAlign = 'left';
  g.fillText(timeOfDay(now_ms - 60_000), PAD.left, height - 8);
  g.textAlign = 'right';
  g.fillText('now', width - PAD.right, height - 8);
  g.strokeStyle = colour('you');
  g.lineWidth = 2;
  g.setLineDash([7, 4]);
  course(g, limits, x, y);
  g.setLineDash([]);
  const last = limits.findLast((limit) => limit !== null);
  if (last !== undefined && last !== null) {
    g.fillStyle = colour('you');
    g.font = `700 13px ${face}`;
    g.textAlign = 'left';
    g.fillText(`limit ${fixed(last)}`, PAD.left + 6, Math.max(PAD.top + 8, y(last) - 9));
  }
  g.strokeStyle = colour('ink');
  g.lineWidth = 2.5;
  g.lineJoin = 'round';
  course(g, values, x, y);
}

/** The newest at the right edge. @param {(number | null)[]} values */
function padded(values) {
  return [...Array.from({ length: Math.max(0, STEPS - values.length) }, () => null), ...values];
}

/** @param {CanvasRenderingContext2D} g @param {(number | null)[]} values @param {(step: number) => number} x @param {(value: number) => number} y */
function course(g, values, x, y) {
  g.beginPath();
  let isDown = false;
  values.forEach((value, i) => {
    if (value !== null) {
      if (isDown) g.lineTo(x(i + 0.5), y(value));
      else {
        g.moveTo(x(i), y(value));
        g.lineTo(x(i + 0.5), y(value));
      }
    }
    isDown = value !== null;
  });
  g.stroke();
}

/** @param {CanvasRenderingContext2D} g @param {number[][]} bands left and right @param {[number, number]} tall top and bottom @param {string} colour */
function hatch(g, bands, [top, bottom], colour) {
  g.save();
  g.beginPath();
  for (const [from = 0, to = 0] of bands) g.rect(from, top, to - from, bottom - top);
  g.clip();
  g.strokeStyle = colour;
  g.lineWidth = 2.5;
  g.beginPath();
  const rise = bottom - top;
  for (let at = -rise; bands.length && at < g.canvas.clientWidth; at += 10) {
    g.moveTo(at, bottom);
    g.lineTo(at + rise, top);
  }
  g.stroke();
  g.restore();
}

/** @param {CanvasRenderingContext2D} g @param {number[][]} points */
function path(g, points) {
  g.beginPath();
  for (const [x = 0, y = 0] of points) g.lineTo(x, y);
  g.stroke();
}
