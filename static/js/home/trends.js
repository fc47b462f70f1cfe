// The last minute on Home: one sparkline for each signal, in fixed places; a press opens it as a chart.

import { field, html, listen, setAttribute, setText } from '../core/dom.js';
import { write } from '../core/ink.js';
import { colours, drawSpark } from './spark.js';
import { Trends, nowOf } from './trend-feed.js';
import { SPECS } from './trends-layout.js';
import { shownIn } from '../core/units.js';

/** A sparkline of 162 px a minute moves by about one pixel in this time [ms]. */
const DRAW_EVERY_MS = 400;

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const trends = new Trends(store);
  const list = field(root, 'sparks');
  const rows = SPECS.map(buildRow);
  list.append(...rows.map(({ key }) => html('li', {}, key)));
  /** @type {import('./spark.js').Palette} */
  let palette = colours(root);
  let isSeen = false;
  let drew_ms = -Infinity;

  const watcher = new IntersectionObserver(([entry]) => {
    isSeen = entry?.isIntersecting ?? false;
    drew_ms = -Infinity;
    if (isSeen) draw();
  });
  watcher.observe(list);
  const redraw = () => {
    palette = colours(root);
    drew_ms = -Infinity;
    draw();
  };
  const stops = [
    store.on('draw', draw),
    listen(window, 'catgraph-theme', redraw),
    listen(matchMedia('(prefers-color-scheme: light)'), 'change', redraw),
    listen(window, 'catgraph-units', redraw),
    listen(window, 'resize', redraw),
    // The chart and its library are loaded by the first press: most drives need neither.
    ...rows.map(({ spec, key }) => listen(key, 'click', () => {
      import('./chart.js').then((chart) => {
        setText(field(root, 'sparks-says'), 'now at the right');
        return chart.open(spec, trends, store);
      }).catch(() => setText(field(root, 'sparks-says'), 'the chart could not be fetched'));
    })),
  ];

  function draw() {
    if (!isSeen || document.hidden) return;
    for (const row of rows) drawText(row, store);
    if (store.now() - drew_ms < DRAW_EVERY_MS) return;
    drew_ms = store.now();
    for (const { spec, canvas } of rows) drawSpark(canvas, spec, trends, store, palette);
  }

  draw();
  return () => {
    watcher.disconnect();
    for (const stop of stops) stop();
  };
}

/** Builds the key of one signal. @param {import('./trends-layout.js').Spec} spec */
function buildRow(spec) {
  const value = html('span', { class: 'n' });
  const label = html('span', {});
  const canvas = /** @type {HTMLCanvasElement} */ (html('canvas', { class: 'spark', 'aria-hidden': 'true' }));
  const key = html('button', { type: 'button', 'aria-haspopup': 'dialog', 'aria-label': `${spec.title}: open the chart of the last minute`, 'data-trend': spec.name }, html('span', { class: 'row' }, label, value), canvas);
  return { spec, value, label, canvas, key };
}

/** @param {ReturnType<typeof buildRow>} row @param {import('../core/store.js').Store} store */
function drawText({ spec, label, value, key }, store) {
  const { unit } = shownIn(0, spec.unit);
  const { text, ink } = nowOf(spec, store);
  setText(label, spec.name === 'acceleration' ? spec.label : `${spec.label} ${unit}`); // its unit has no room beside it
  write(value, ink, text);
  setAttribute(key, 'aria-label', `${spec.title}: ${ink === 'stale' ? 'stale, last ' : ''}${text} ${unit}; open the chart of the last minute`);
}
