// The way of the car on the ground, with its alarms and the place at the needle.

import { colour, fitted, must } from './elements.js';
import { indexAt, roundStep } from './layout.js';
import { data, followers, go, redraws, repaints, view } from './view.js';

const DOT_EVERY_S = data.to - data.from > 600 ? 60 : 10;

/**
 * @typedef {{t: number[], e: number[], n: number[]}} Way
 * @typedef {{x: (e: number) => number, y: (n: number) => number}} Place pixels of a place
 */

export function mountTrack() {
  const way = data.track;
  if (!way) return;
  const section = /** @type {HTMLElement} */ (document.querySelector('.way'));
  section.hidden = false;
  const canvas = /** @type {HTMLCanvasElement} */ (must('track'));
  const middle = { e: (least(way.e) + most(way.e)) / 2, n: (least(way.n) + most(way.n)) / 2 };
  const extent = { e: Math.max(most(way.e) - least(way.e), 4), n: Math.max(most(way.n) - least(way.n), 4) };
  /** @type {Place | null} */
  let place = null;

  const draw = () => {
    const { ctx, width, height } = fitted(canvas);
    const scale = Math.min((width - 48) / extent.e, (height - 56) / extent.n);
    place = { x: (e) => width / 2 + (e - middle.e) * scale, y: (n) => height / 2 - (n - middle.n) * scale };
    const step = roundStep(Math.max(width, height) / scale);
    drawGrid(ctx, place, { width, height }, { west: middle.e - width / 2 / scale, south: middle.n - height / 2 / scale, step });
    drawWay(ctx, way, place);
    const now = Math.max(0, indexAt(way.t, view.at));
    dart(ctx, place.x(way.e[now]), place.y(way.n[now]), headingAt(way, now));
    scaleBar(ctx, height, step * scale, step);
    north(ctx, width);
  };
  must('track-note').textContent = `A dot each ${DOT_EVERY_S} s; thick where an alarm stood. Point at it to read the moment.`;
  redraws.push(draw);
  repaints.push(draw);
  followers.push(draw);
  const point = (/** @type {PointerEvent} */ event) => {
    if (place) go(way.t[nearest(way, place, canvas, event)]);
  };
  canvas.addEventListener('pointermove', point);
  canvas.addEventListener('pointerdown', point);
}

const least = (/** @type {number[]} */ values) => Math.min(...values);
const most = (/** @type {number[]} */ values) => Math.max(...values);

/** Returns the index of the point of the way that is nearest to the pointer. @param {Way} way @param {Place} place
 * @param {HTMLElement} canvas @param {PointerEvent} event */
function nearest(way, { x, y }, canvas, event) {
  const box = canvas.getBoundingClientRect();
  const [px, py] = [event.clientX - box.left, event.clientY - box.top];
  let [best, nearest_px2] = [0, Infinity];
  for (let index = 0; index < way.t.length; index += 1) {
    const far = (x(way.e[index]) - px) ** 2 + (y(way.n[index]) - py) ** 2;
    if (far < nearest_px2) [nearest_px2, best] = [far, index];
  }
  return best;
}

/** Draws lines every `step` metres. @param {CanvasRenderingContext2D} ctx @param {Place} place
 * @param {{width: number, height: number}} size @param {{west: number, south: number, step: number}} from */
function drawGrid(ctx, { x, y }, { width, height }, { west, south, step }) {
  ctx.lineWidth = 1;
  ctx.strokeStyle = colour('line');
  ctx.beginPath();
  for (let e = Math.ceil(west / step) * step; x(e) < width; e += step) { ctx.moveTo(x(e), 0); ctx.lineTo(x(e), height); }
  for (let n = Math.ceil(south / step) * step; y(n) > 0; n += step) { ctx.moveTo(0, y(n)); ctx.lineTo(width, y(n)); }
  ctx.stroke();
}

/** Draws the way, its shown part, the alarms on it and a dot at each full interval.
 * @param {CanvasRenderingContext2D} ctx @param {Way} way @param {Place} place */
function drawWay(ctx, way, { x, y }) {
  stroke(ctx, way, x, y, 0, way.t.length - 1, colour('edge'), 2);
  stroke(ctx, way, x, y, Math.max(0, indexAt(way.t, view.from)), indexAt(way.t, view.to), colour('ink'), 3);
  for (const bar of data.episodes) {
    if (bar.priority === 'advisory') continue;
    const from = Math.max(0, indexAt(way.t, bar.from));
    stroke(ctx, way, x, y, from, Math.max(from, indexAt(way.t, bar.to)), colour(bar.priority === 'critical' ? 'crit' : 'warn'), 6);
  }
  ctx.fillStyle = colour('ink');
  for (let index = 0, due = way.t[0]; index < way.t.length; index += 1) {
    if (way.t[index] >= due) { disc(ctx, x(way.e[index]), y(way.n[index]), 3.5); due += DOT_EVERY_S; }
  }
}

/** @param {CanvasRenderingContext2D} ctx @param {Way} way @param {(e: number) => number} x @param {(n: number) => number} y
 * @param {number} first @param {number} last @param {string} ink @param {number} width */
function stroke(ctx, way, x, y, first, last, ink, width) {
  ctx.beginPath();
  for (let index = first; index <= last; index += 1) {
    if (index > first && way.t[index] - way.t[index - 1] > 5) ctx.moveTo(x(way.e[index]), y(way.n[index]));
    else ctx.lineTo(x(way.e[index]), y(way.n[index]));
  }
  ctx.strokeStyle = ink;
  ctx.lineWidth = width;
  ctx.lineJoin = ctx.lineCap = 'round';
  ctx.stroke();
}

/** Returns the direction of the way around a point, clockwise from north; null while the car stands. */
function headingAt(/** @type {Way} */ way, /** @type {number} */ now) {
  for (let back = 1; back < 60; back += 1) {
    const [from, to] = [Math.max(0, now - back), Math.min(way.t.length - 1, now + back)];
    const [e, n] = [way.e[to] - way.e[from], way.n[to] - way.n[from]];
    if (Math.hypot(e, n) > 1.5) return Math.atan2(e, n);
  }
  return null;
}

/** @param {CanvasRenderingContext2D} ctx @param {number} x @param {number} y @param {number} radius */
function disc(ctx, x, y, radius) {
  ctx.beginPath();
  ctx.arc(x, y, radius, 0, 2 * Math.PI);
  ctx.fill();
}

/** @param {CanvasRenderingContext2D} ctx @param {number} x @param {number} y @param {number | null} heading */
function dart(ctx, x, y, heading) {
  ctx.save();
  ctx.translate(x, y);
  ctx.fillStyle = colour('ink');
  ctx.strokeStyle = colour('panel');
  ctx.lineWidth = 3;
  ctx.beginPath();
  if (heading === null) ctx.arc(0, 0, 8, 0, 2 * Math.PI);
  else {
    ctx.rotate(heading);
    ctx.moveTo(0, -15); ctx.lineTo(10, 12); ctx.lineTo(0, 6); ctx.lineTo(-10, 12); ctx.closePath();
  }
  ctx.stroke();
  ctx.fill();
  ctx.restore();
}

/** @param {CanvasRenderingContext2D} ctx @param {number} height @param {number} width @param {number} metres */
function scaleBar(ctx, height, width, metres) {
  ctx.fillStyle = ctx.strokeStyle = colour('ink');
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.moveTo(12, height - 18); ctx.lineTo(12, height - 12); ctx.lineTo(12 + width, height - 12); ctx.lineTo(12 + width, height - 18);
  ctx.stroke();
  ctx.font = '15px "catgraph numerals", system-ui';
  ctx.textAlign = 'left';
  ctx.fillText(metres >= 1000 ? `${metres / 1000} km` : `${Number(metres.toPrecision(2))} m`, 12, height - 24);
}

function north(/** @type {CanvasRenderingContext2D} */ ctx, /** @type {number} */ width) {
  ctx.beginPath();
  ctx.moveTo(width - 18, 10); ctx.lineTo(width - 11, 30); ctx.lineTo(width - 18, 25); ctx.lineTo(width - 25, 30); ctx.closePath();
  ctx.fill();
  ctx.font = '700 14px system-ui';
  ctx.textAlign = 'center';
  ctx.fillText('N', width - 18, 46);
}
