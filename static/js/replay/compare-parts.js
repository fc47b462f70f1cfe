// The elements of a comparison, and its style sheet.

import { html, icon } from '../core/dom.js';

/** The times in view that have a key [s]. */
export const RANGES = /** @type {const} */ ([['60 s', 60], ['6 min', 360], ['All', Infinity]]);
/** The steps by which B is moved along the time line [s]. */
export const STEPS = /** @type {const} */ ([['−1 s', -1], ['−0.1', -0.1], ['+0.1', 0.1], ['+1 s', 1]]);

export function build() {
  const title = html('h2', { tabindex: -1 }, 'Compare');
  const seg = (/** @type {string} */ label, /** @type {HTMLElement[]} */ keys) => html('div', { class: 'seg', role: 'group', 'aria-label': label }, ...keys);
  const key = (/** @type {string} */ label, kind = '') => html('button', { type: 'button', ...(kind ? { class: kind } : { 'aria-pressed': 'false' }) }, label);
  const ranges = RANGES.map(([name]) => key(name));
  const aligns = { start: key('Same start'), clock: key('Clock'), motion: key('First motion'), alarm: key('Same alarm') };
  const steps = STEPS.map(([name, by_s]) => html('button', { type: 'button', class: 'key n', 'aria-label': `B ${Math.abs(by_s)} s ${by_s < 0 ? 'earlier' : 'later'}` }, name));
  const count = html('span', {});
  const signals = html('button', { type: 'button', class: 'key', 'aria-haspopup': 'dialog' }, icon('plus', 's'), count);
  const state = html('p', { class: 'cmp-state', role: 'status' });
  const figures = html('div');
  const plots = html('div', { class: 'cmp-panes' });
  const none = html('p', { class: 'cmp-none sub' });
  const stage = html('div', { class: 'cmp-stage' }, plots, none);
  const sides = html('div', { class: 'cmp-sides' });
  const element = html('section', { class: 'compare', 'aria-label': 'Comparison of two recordings' },
    html('div', { class: 'cmp-bar' }, title, state, html('div', { class: 'cmp-steps', role: 'group', 'aria-label': 'Move B' }, ...steps), seg('Align by', Object.values(aligns)), seg('Time in view', ranges), signals),
    figures, sides, stage);
  return { element, title, state, steps, aligns, ranges, signals, count, figures, plots, none, stage, sides };
}
