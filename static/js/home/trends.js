// The last minute on Home: one sparkline for each signal, in fixed places; a press opens the chart of the drive.

import { field, html, listen, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { isAbsent, write } from '../core/ink.js';
import { showInTrends } from './drive-choice.js';
import { colours, drawSpark } from './spark.js';
import { nowOf, trendsOf } from './trend-feed.js';
import { SPECS, specOf } from './trends-layout.js';
import { fixed, NOTHING } from '../core/format.js';
import { shownIn } from '../core/units.js';
import { floorQuery, isFloor } from '../shell/layout.js';

/** Drawn at every second drawing, 400 ms: in that time a sparkline of 162 px a minute moves by about one pixel. */
const TURNS = 2;
/** A pane of a wide screen that is as high has room for the chart itself [px]. */
const CHART_PX = 240;

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @param {(sentence: string, title?: string) => void} say
 */
export function mount(root, store, say) {
  const trends = trendsOf(store);
  const list = field(root, 'sparks');
  /** @type {Map<string, ReturnType<typeof buildRow>>} */
  const rows = new Map();
  /** @type {import('./spark.js').Palette} */
  let palette;
  let isSeen = false;
  let isOver = false;
  let turn = 0;

  const watcher = new IntersectionObserver((entries) => {
    isSeen = entries.at(-1)?.isIntersecting ?? false; // the newest
    redraw();
  });
  watcher.observe(list);
  const redraw = () => {
    if (!isSeen) return; // to read the colours costs a style of the page
    palette = colours(root);
    draw();
    for (const row of rows.values()) drawSketch(row, trends, store, palette);
  };
  const stops = [
    store.on('draw', () => store.painter.inTurn(draw)),
    listen(window, 'catgraph-theme', redraw),
    listen(matchMedia('(prefers-color-scheme: light)'), 'change', redraw),
    listen(window, 'catgraph-units', redraw),
    listen(window, 'resize', redraw),
  ];
  for (const spec of SPECS) add(spec);
  stops.push(mountHere(root, list, store, say));

  /** @param {import('./trends-layout.js').Spec} spec */
  function add(spec) {
    const row = buildRow(spec);
    rows.set(spec.name, row);
    list.append(html('li', {}, row.key));
    stops.push(listen(row.key, 'click', () => showInTrends(spec.name)));
  }

  function draw() {
    if (isOver || !isSeen || document.hidden) return;
    for (const name of Object.keys(store.frame?.trends?.lowest ?? {})) {
      const signal = store.signal(name);
      if (signal && !rows.has(name)) add(specOf(name, signal));
    }
    for (const row of rows.values()) drawText(row, store);
    turn = (turn + 1) % TURNS;
    const due = [...rows.values()].filter((_, i) => i % TURNS === turn);
    store.painter.inTurn(() => {
      for (const row of isOver ? [] : due) drawSketch(row, trends, store, palette);
    });
  }

  return () => {
    isOver = true;
    watcher.disconnect();
    for (const stop of stops) stop();
  };
}

/** Builds the key of one signal. @param {import('./trends-layout.js').Spec} spec */
function buildRow(spec) {
  const value = html('span', { class: 'n' });
  const label = html('span', {});
  const scale = [html('span', {}), html('span', {})];
  const canvas = /** @type {HTMLCanvasElement} */ (html('canvas', { class: 'spark', 'aria-hidden': 'true' }));
  const key = html('button', { type: 'button', 'aria-label': `${spec.title}: open the chart of the drive`, 'data-trend': spec.name }, html('span', { class: 'row' }, label, value), html('span', { class: 'scaled' }, html('span', { class: 'scale n', 'aria-hidden': 'true' }, ...scale), canvas));
  return { spec, value, label, canvas, key, scale };
}

/** @param {ReturnType<typeof buildRow>} row @param {import('../core/store.js').Store} store */
function drawText({ spec, label, value, key }, store) {
  const { unit } = shownIn(0, spec.unit);
  const { text, ink } = nowOf(spec, store);
  setText(label, `${spec.name === 'acceleration' ? 'Accel.' : spec.label} ${unit}`); // whole, its unit has no room beside it
  write(value, ink, text);
  if (isAbsent(ink)) setText(value, NOTHING); // the text has no room: the label of the key has it
  setAttribute(key, 'aria-label', `${spec.title}: ${ink === 'stale' ? 'stale, last ' : ''}${text} ${unit}; open the chart of the drive`);
}

/**
 * @param {ReturnType<typeof buildRow>} row
 * @param {ReturnType<typeof trendsOf>} trends
 * @param {import('../core/store.js').Store} store
 * @param {import('./spark.js').Palette} palette
 */
function drawSketch({ spec, canvas, scale }, trends, store, palette) {
  const ends = drawSpark(canvas, spec, trends, store, palette);
  [ends?.[1], ends?.[0]].forEach((end, i) => setText(/** @type {Element} */ (scale[i]), endWords(end, spec)));
}

/** An end of the scale; '': there is none. @param {number | undefined} end of the wire @param {import('./trends-layout.js').Spec} spec */
function endWords(end, spec) {
  if (end === undefined) return '';
  const { value } = shownIn(end, spec.unit);
  return fixed(value, Math.abs(value) < 10 && !Number.isInteger(value) ? 1 : 0);
}

/**
 * On a wide screen the chart of the drive stands in the pane, in the place of the last minute.
 * @param {HTMLElement} root
 * @param {HTMLElement} list of the sparklines
 * @param {import('../core/store.js').Store} store
 * @param {(sentence: string, title?: string) => void} say
 */
function mountHere(root, list, store, say) {
  const place = html('div', { class: 'trends-here', hidden: true });
  root.append(place);
  /** @type {(() => void) | null} */
  let unmount = null;
  let isHere = false;
  const look = async () => {
    const hasRoom = isFloor() && root.clientHeight >= CHART_PX;
    if (hasRoom === isHere) return;
    isHere = hasRoom;
    unmount?.();
    unmount = null;
    const chart = hasRoom ? await import('./drive-chart.js').catch(() => null) : null;
    if (isHere !== hasRoom) return; // turned meanwhile
    show(place, chart !== null);
    show(list, chart === null);
    setSentence(field(root, 'sparks-title'), chart ? 'Trends' : 'Last 60 s');
    setText(field(root, 'sparks-message'), chart ? '' : 'now at the right');
    if (chart) unmount = chart.mount(place, { store, say });
  };
  const resize = new ResizeObserver(() => void look());
  resize.observe(root);
  const stop = listen(floorQuery(), 'change', () => void look());
  return () => {
    stop();
    resize.disconnect();
    unmount?.();
  };
}
