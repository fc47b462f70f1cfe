// The elements of the chart of a drive, and its style sheets.

import { html, icon, svg } from '../core/dom.js';
import { fetchStyle, styled } from '../core/style-sheet.js';

/** The times in view that have a key [s]. */
export const RANGES = /** @type {const} */ ([['60 s', 60], ['6 min', 360], ['Drive', Infinity]]);

/** @param {HTMLElement} root */
export function build(root) {
  const ranges = RANGES.map(([name]) => html('button', { type: 'button', 'aria-pressed': 'false' }, html('span', { class: 'n' }, name)));
  const count = html('span', { class: 'n' });
  const signals = html('button', { type: 'button', class: 'key wide', 'aria-haspopup': 'dialog', 'aria-label': 'Signals and export' }, icon('plus', 's'), count);
  const held = html('span', {});
  const now = html('button', { type: 'button', class: 'key', hidden: true }, 'Now');
  const state = html('div', { class: 'trends-state', role: 'status' }, held, now);
  const head = svg('svg', { class: 'trends-marks', height: 28 });
  const plots = html('div', { class: 'trends-panes' });
  const stage = html('div', { class: 'trends-stage', role: 'slider', tabindex: 0, 'aria-label': 'Moment read off the chart', 'aria-valuemin': 0, 'aria-valuemax': 0, 'aria-valuenow': 0 }, head, plots);
  const element = html('div', { class: 'trends' },
    html('div', { class: 'trends-tools' }, html('div', { class: 'seg', role: 'group', 'aria-label': 'Time in view' }, ...ranges), signals), state, stage);
  root.replaceChildren(element);
  return { element, ranges, signals, count, state, held, now, head, plots, stage };
}

/** The style sheets of the chart; without them it lacks its look, not its truth. */
export const chartStyles = () => Promise.all([styled('trends'), fetchStyle(new URL('../../vendor/uPlot.min.css', import.meta.url).href).catch(() => {})]);
