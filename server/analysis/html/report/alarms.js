// The alarms of the report: their bars on the time axis, and the lists beside it.

import { icon, make, must } from './elements.js';
import { clock, lanesOf } from './layout.js';
import { data, lay, redraws, show, timeline, view } from './view.js';

const AROUND_S = 6; // an alarm is shown with so much before and after it
const ICONS = { critical: 'crit', warning: 'warn', advisory: 'info' };

export function mountLanes() {
  const root = must('lanes');
  for (const lane of lanesOf(data.episodes)) {
    const track = make('div', { class: 'track' });
    for (const { bar, index } of lane.bars) {
      const button = /** @type {HTMLButtonElement} */ (make('button', {
        type: 'button',
        'aria-label': `${bar.title}, ${clock(bar.from)} to ${bar.open ? 'the end' : clock(bar.to)}`,
      }));
      button.title = button.getAttribute('aria-label') ?? '';
      button.addEventListener('click', (event) => { event.stopPropagation(); choose(index); });
      track.append(button);
      const hidden = bar.hidden.map(([from, to]) => ({ from, to, element: make('i', { class: 'hidden' }) }));
      track.append(...hidden.map(({ element }) => element));
      redraws.push(() => {
        lay(button, bar.from, bar.to);
        for (const part of hidden) lay(part.element, part.from, part.to);
      });
    }
    root.append(make('div', { class: 'lane', 'data-priority': lane.priority }, track,
      make('div', { class: 'name' }, icon(ICONS[/** @type {keyof typeof ICONS} */ (lane.priority)] ?? 'info'), lane.title)));
  }
  for (const lane of lanesOf(data.before)) {
    addMarks(root, 'before', `before: ${lane.title}`, lane.bars.map(({ bar }) => [bar.from, bar.to]));
  }
  for (const [name, from, to] of data.injected) addMarks(root, 'injected', `injected: ${name}`, [[from, to]]);
}

/** @param {HTMLElement} root @param {string} kind @param {string} name @param {number[][]} spans */
function addMarks(root, kind, name, spans) {
  const track = make('div', { class: 'track' });
  for (const [from, to] of spans) {
    const mark = make('i');
    track.append(mark);
    redraws.push(() => lay(mark, from, to));
  }
  root.append(make('div', { class: 'lane', 'data-priority': kind }, track, make('div', { class: 'name' }, name)));
}

/** Shows an alarm with the time before and after it. */
export function choose(/** @type {number} */ index) {
  const bar = data.episodes[index];
  for (const row of document.querySelectorAll('.alarm')) {
    if (/** @type {HTMLElement} */ (row).dataset.episode === String(index)) row.setAttribute('aria-current', 'true');
    else row.removeAttribute('aria-current');
  }
  view.at = bar.from;
  show(bar.from - AROUND_S, Math.min(bar.to, bar.from + 60) + AROUND_S);
}

export function mountChoices() {
  for (const row of document.querySelectorAll('.alarm')) {
    row.addEventListener('click', () => {
      choose(Number(/** @type {HTMLElement} */ (row).dataset.episode));
      reveal();
    });
  }
  for (const row of document.querySelectorAll('.change')) {
    const { at, until } = /** @type {HTMLElement} */ (row).dataset;
    row.addEventListener('click', () => {
      view.at = Number(at);
      show(Number(at) - AROUND_S, Math.min(Number(until), Number(at) + 60) + AROUND_S);
      reveal();
    });
  }
}

/** Scrolls to the plots where they are out of sight, below the lists. */
function reveal() {
  const box = timeline.getBoundingClientRect();
  if (box.top > innerHeight * 0.7 || box.bottom < innerHeight * 0.3) must('h-time').scrollIntoView();
}
