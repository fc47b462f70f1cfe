// The shown part of the drive and the needle, and their place on the time axis.

import { must } from './elements.js';
import { within } from './layout.js';

export const GUTTER = 52; // as in report.css
export const SIDE = 16;

/** @import { Data } from './layout.js' */
/** @type {Data} */
export const data = JSON.parse(must('data').textContent ?? '');
const worst = data.episodes.find((bar) => bar.priority === 'critical') ?? data.episodes[0];
export const view = { from: data.from, to: data.to, at: worst ? worst.from : (data.from + data.to) / 2 };
/** @type {(() => void)[]} run when the view changes */
export const redraws = [];
/** @type {(() => void)[]} run when the needle moves */
export const followers = [];
/** @type {(() => void)[]} run when the colours change */
export const repaints = [];

export const timeline = must('timeline');

function spanPx() {
  return Math.max(1, timeline.clientWidth - GUTTER - SIDE);
}

export function xOf(/** @type {number} */ at) {
  return GUTTER + ((at - view.from) / (view.to - view.from)) * spanPx();
}

export function timeAt(/** @type {number} */ clientX) {
  const x = clientX - timeline.getBoundingClientRect().left - GUTTER;
  const at = view.from + (x / spanPx()) * (view.to - view.from);
  return Math.min(Math.max(at, view.from), view.to);
}

export function show(/** @type {number} */ from, /** @type {number} */ to) {
  Object.assign(view, within(from, to, data.from, data.to));
  view.at = Math.min(Math.max(view.at, view.from), view.to);
  for (const redraw of redraws) redraw();
  follow();
}

export function go(/** @type {number} */ at) {
  view.at = Math.min(Math.max(at, data.from), data.to);
  if (view.at < view.from || view.at > view.to) {
    const half = (view.to - view.from) / 2;
    show(view.at - half, view.at + half);
  } else follow();
}

let isDue = false;
function follow() {
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(() => {
    isDue = false;
    for (const follower of followers) follower();
  });
}

/** Places a bar by its times, as parts of the width of its track. */
export function lay(/** @type {HTMLElement} */ bar, /** @type {number} */ from, /** @type {number} */ to) {
  const span = view.to - view.from;
  const left = Math.max(-1, (from - view.from) / span);
  const right = Math.min(2, (to - view.from) / span);
  bar.hidden = right < 0 || left > 1;
  bar.style.left = `${left * 100}%`;
  bar.style.width = `${Math.max(0, right - left) * 100}%`;
}
