// The drive's chart as it is seen, as one picture that speaks for itself: of which car and day, with its marks and the cursor's time.

import { timeOfDay } from '../core/format.js';

/** Height of the line that names car, day and time [px]. */
const TITLE_PX = 30;

/**
 * @typedef {object} Seen
 * @property {import('./drive-panes.js').Panes} panes
 * @property {SVGElement} head the marks and the time at the cursor
 * @property {string} title
 */

/**
 * Names the car, the local day, and from when to when.
 * @param {string} car
 * @param {import('./drive-layout.js').Answer} answer
 * @param {import('./drive-layout.js').View} view
 * @param {boolean} isReplay
 */
export function titleOf(car, answer, [from_s, to_s], isReplay) {
  const [from_ms, to_ms] = [from_s, to_s].map((at_s) => answer.start_ms + at_s * 1000);
  const at = new Date(from_ms ?? 0);
  const day = [at.getFullYear(), at.getMonth() + 1, at.getDate()].map((part) => String(part).padStart(2, '0')).join('-');
  return `${car}${isReplay ? ', recording' : ''} · ${day} · ${timeOfDay(from_ms ?? 0)} to ${timeOfDay(to_ms ?? 0)}`;
}

/**
 * @param {Seen} seen
 * @returns {HTMLCanvasElement}
 */
export function pictureOf({ panes, head, title }) {
  const { palette, root } = panes;
  const ratio = devicePixelRatio || 1;
  const [whole, top] = [root.getBoundingClientRect(), head.getBoundingClientRect()];
  const above = TITLE_PX + top.height;
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [Math.round(whole.width * ratio), Math.round((above + whole.height) * ratio)];
  const g = /** @type {CanvasRenderingContext2D} */ (canvas.getContext('2d'));
  g.fillStyle = palette.panel;
  g.fillRect(0, 0, canvas.width, canvas.height);
  g.scale(ratio, ratio);
  g.textBaseline = 'top';
  const face = getComputedStyle(document.body).fontFamily;
  g.fillStyle = palette.ink;
  g.font = `700 14px ${face}`;
  g.fillText(title, 8, 8, whole.width - 16);
  g.save();
  g.translate(top.left - whole.left, TITLE_PX);
  drawHead(g, head);
  g.restore();
  for (const { plot, element, label, value, unit } of panes.panes) {
    const box = plot.ctx.canvas.getBoundingClientRect();
    const at = above + element.getBoundingClientRect().top - whole.top;
    g.drawImage(plot.ctx.canvas, box.left - whole.left, above + box.top - whole.top, box.width, box.height);
    g.font = `14px ${face}`;
    g.fillStyle = palette.ink2;
    g.fillText(`${label.textContent}`, 8, at + 6, 84);
    g.fillStyle = palette.ink;
    g.fillText(`${value.textContent} ${unit.textContent}`, 8, at + 26, 84);
  }
  return canvas;
}

/** The marks by the paths of their icons, and the tag of the cursor. @param {CanvasRenderingContext2D} g @param {SVGElement} head */
function drawHead(g, head) {
  for (const mark of /** @type {NodeListOf<SVGGElement>} */ (head.querySelectorAll('g'))) {
    const [use, bar] = [mark.querySelector('use'), mark.querySelector('rect')];
    const path = use && document.querySelector(`${use.getAttribute('href')} path`)?.getAttribute('d');
    const place = mark.transform.baseVal.consolidate()?.matrix;
    if (!(path || bar) || !place) continue;
    g.save();
    g.translate(place.e, place.f);
    if (bar) {
      g.fillStyle = getComputedStyle(mark).color;
      g.fillRect(bar.x.baseVal.value, bar.y.baseVal.value, bar.width.baseVal.value, bar.height.baseVal.value);
    }
    g.scale(22 / 24, 22 / 24);
    g.strokeStyle = getComputedStyle(mark).color;
    [g.lineWidth, g.lineCap, g.lineJoin] = [2, 'round', 'round'];
    if (path) g.stroke(new Path2D(path));
    g.restore();
  }
  const [box, text] = [head.querySelector('.tag-box'), head.querySelector('.tag-text')];
  if (!(box instanceof SVGRectElement) || !text) return;
  g.fillStyle = getComputedStyle(box).fill;
  g.fillRect(box.x.baseVal.value, box.y.baseVal.value, box.width.baseVal.value, box.height.baseVal.value);
  g.fillStyle = getComputedStyle(text).fill;
  g.font = `700 16px ${getComputedStyle(text).fontFamily}`;
  g.textAlign = 'center';
  g.fillText(text.textContent ?? '', box.x.baseVal.value + box.width.baseVal.value / 2, 6);
  g.textAlign = 'start';
}
