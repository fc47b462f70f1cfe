// The plots of `catgraph check`: one time axis for alarm bars, curves, checks and the track; a needle reads them all.
// server/analysis/page.py joins the modules to one script, with uPlot above them.

import { mountChoices, mountLanes } from './report/alarms.js';
import { colours, must } from './report/elements.js';
import { mountOverview } from './report/overview.js';
import { mountPanel, mountCheckTimelines } from './report/plots.js';
import { mountTrack } from './report/track.js';
import { data, followers, go, repaints, show, timeAt, timeline, view, xOf } from './report/view.js';

await Promise.allSettled([document.fonts.load('14px "catgraph numerals"'), document.fonts.load('700 14px "catgraph numerals"')]);
mountLanes();
data.panels.forEach(mountPanel);
mountCheckTimelines();
mountTrack();
mountOverview();
mountChoices();
mountPointer();
mountTheme();
show(data.from, data.to);
new ResizeObserver(() => show(view.from, view.to)).observe(timeline);

function mountPointer() {
  const needle = must('needle');
  const chosen = must('chosen');
  /** @type {number | null} */
  let pressed = null;
  followers.push(() => {
    needle.hidden = false;
    needle.style.transform = `translateX(${xOf(view.at)}px)`;
  });
  const move = (/** @type {PointerEvent} */ event) => {
    if (pressed !== null && event.pointerType === 'mouse') {
      const [from, to] = [Math.min(pressed, event.clientX), Math.max(pressed, event.clientX)];
      const left = timeline.getBoundingClientRect().left;
      chosen.hidden = to - from < 6;
      chosen.style.left = `${from - left}px`;
      chosen.style.width = `${to - from}px`;
    }
    go(timeAt(event.clientX));
  };
  timeline.addEventListener('pointermove', move);
  timeline.addEventListener('pointerdown', (event) => {
    if (event.target instanceof Element && event.target.closest('button')) return;
    if (event.pointerType === 'mouse') {
      pressed = event.clientX;
      timeline.setPointerCapture(event.pointerId);
    }
    move(event);
  });
  const release = (/** @type {PointerEvent} */ event) => {
    const from = pressed;
    pressed = null;
    chosen.hidden = true;
    if (from !== null && event.type === 'pointerup' && Math.abs(event.clientX - from) >= 6) {
      const times = [timeAt(from), timeAt(event.clientX)].sort((a, b) => a - b);
      show(times[0], times[1]);
    }
  };
  timeline.addEventListener('pointerup', release);
  timeline.addEventListener('pointercancel', release);
  timeline.addEventListener('dblclick', () => show(data.from, data.to));
}

function mountTheme() {
  const dark = matchMedia('(prefers-color-scheme: dark)');
  const repaint = () => {
    colours.clear();
    for (const paint of repaints) paint();
  };
  must('theme').addEventListener('click', () => {
    const root = document.documentElement;
    const isDark = root.dataset.theme ? root.dataset.theme === 'dark' : dark.matches;
    root.dataset.theme = isDark ? 'light' : 'dark';
    repaint();
  });
  dark.addEventListener('change', repaint);
}
