// The bar at the foot of the report: the whole drive, the needle as a slider, and keys from alarm to alarm.

import { choose } from './alarms.js';
import { colour, fitted, must } from './elements.js';
import { clock } from './layout.js';
import { data, followers, go, redraws, repaints, show, view } from './view.js';

export function mountOverview() {
  /** @type {HTMLElement} */ (document.querySelector('.rail')).hidden = false;
  const canvas = /** @type {HTMLCanvasElement} */ (must('overview'));
  const scrub = /** @type {HTMLInputElement} */ (must('scrub'));
  Object.assign(scrub, { min: String(data.from), max: String(data.to), step: '0.1', value: String(data.from) });
  scrub.addEventListener('input', () => go(Number(scrub.value)));
  const curve = data.panels[0]?.curves.findLast((one) => !one.limit);
  const draw = () => {
    const { ctx, width, height } = fitted(canvas);
    const x = (/** @type {number} */ at) => 8 + ((at - data.from) / (data.to - data.from)) * (width - 16);
    const base = height - 6;
    if (view.to - view.from < data.to - data.from - 0.01) {
      ctx.fillStyle = colour('panel');
      ctx.fillRect(x(view.from), 0, x(view.to) - x(view.from), height);
    }
    ctx.strokeStyle = colour('edge');
    ctx.lineWidth = 1.5;
    ctx.beginPath(); ctx.moveTo(8, base); ctx.lineTo(width - 8, base); ctx.stroke();
    if (curve) {
      const values = curve.v.map((value) => Math.abs(value ?? 0));
      const most = values.reduce((a, b) => Math.max(a, b), 0.001);
      ctx.strokeStyle = colour('ink');
      ctx.lineWidth = 2;
      ctx.beginPath();
      const step = Math.max(1, Math.floor(values.length / (width * 2)));
      for (let index = 0; index < values.length; index += step) ctx.lineTo(x(curve.t[index]), base - (values[index] / most) * (height - 24));
      ctx.stroke();
    }
    for (const bar of [...data.episodes].reverse()) mark(ctx, bar.priority, x(bar.from));
    ctx.fillStyle = colour('you');
    ctx.fillRect(x(view.at) - 1.5, 0, 3, height);
  };
  redraws.push(draw);
  repaints.push(draw);
  followers.push(() => {
    draw();
    scrub.value = String(view.at);
    scrub.setAttribute('aria-valuetext', clock(view.at));
    must('now').textContent = clock(view.at);
    must('wall').textContent = data.startMs === null ? '' : new Date(data.startMs + view.at * 1000).toISOString().slice(11, 19);
  });
  const order = data.episodes.map((bar, index) => ({ at: bar.from, index }));
  const previous = /** @type {HTMLButtonElement} */ (must('previous'));
  const following = /** @type {HTMLButtonElement} */ (must('following'));
  previous.disabled = following.disabled = order.length === 0;
  previous.hidden = following.hidden = order.length === 0;
  previous.addEventListener('click', () => choose((order.findLast(({ at }) => at < view.at - 0.05) ?? order[order.length - 1]).index));
  following.addEventListener('click', () => choose((order.find(({ at }) => at > view.at + 0.05) ?? order[0]).index));
  must('all').addEventListener('click', () => show(data.from, data.to));
}

/** @param {CanvasRenderingContext2D} ctx @param {string} priority @param {number} x */
function mark(ctx, priority, x) {
  ctx.beginPath();
  if (priority === 'critical') { ctx.moveTo(x, 0); ctx.lineTo(x + 7, 7); ctx.lineTo(x, 14); ctx.lineTo(x - 7, 7); }
  else if (priority === 'warning') { ctx.moveTo(x, 0); ctx.lineTo(x + 7, 13); ctx.lineTo(x - 7, 13); }
  else ctx.arc(x, 7, 4.5, 0, 2 * Math.PI);
  ctx.closePath();
  ctx.fillStyle = colour(priority === 'critical' ? 'crit' : priority === 'warning' ? 'warn' : 'panel');
  ctx.strokeStyle = colour(priority === 'warning' ? 'warn-edge' : priority === 'critical' ? 'crit' : 'ink');
  ctx.lineWidth = 1.5;
  ctx.fill();
  ctx.stroke();
}
