// The last minute on Home: one small picture a signal, in fixed places; pressed, it opens as a chart.

import { field, html, listen, setAttribute, setText } from '../core/dom.js';
import { ABSENT, write } from '../core/ink.js';
import { Minute, SPAN, SPECS, STEP_S } from './trends-layout.js';
import { shownIn } from '../core/units.js';
import { fixed, signed } from '../core/format.js';

/** A picture of 162 px a minute moves by half a pixel in this time [ms]. */
const DRAW_EVERY_MS = 400;
/** The server is asked for what was missed at most so often [ms]. */
const ASK_EVERY_MS = 2000;
const COLOURS = /** @type {const} */ (['panel', 'line', 'ink', 'you', 'hatch']);
const HEIGHT = 52;

/**
 * @typedef {import('./trends-layout.js').Spec} Spec
 * @typedef {Record<typeof COLOURS[number], string>} Palette
 */

export class Trends {
  minute = new Minute();
  #boot = '';
  #asked_ms = -Infinity;
  #heard_ms = -Infinity;

  /** @param {import('../core/store.js').Store} store */
  constructor(store) {
    this.store = store;
    store.on('beat', () => this.#hear());
  }

  /** The moment of the glass, as a step and its part. */
  get now() {
    return this.minute.now + Math.max(0, this.store.now() - this.#heard_ms) / 1000 / STEP_S;
  }

  /** A signal's minute up to now. @param {Spec} spec @param {number} [now] */
  course(spec, now = this.now) {
    return this.minute.course(spec.name, now, this.store.signal(spec.name)?.period_s ?? null);
  }

  #hear() {
    const { frame } = this.store;
    if (!frame?.trends) return;
    const boot = `${frame.server.boot} ${frame.replay?.token} ${frame.replay?.seek}`; // a leap is another course
    if (boot !== this.#boot) {
      this.minute.clear();
      this.#asked_ms = -Infinity;
    }
    this.#boot = boot;
    this.minute.take(frame.trends);
    // How long the frame was under way counts: the picture's right edge is now, not then.
    this.#heard_ms = this.store.now() - 1000 * Math.max(0, this.store.lag_s);
    if (this.minute.missed !== null && this.store.now() - this.#asked_ms > ASK_EVERY_MS) void this.#ask(this.minute.missed);
  }

  /** What this page missed, the server may still have. Without an answer it stays hatched. @param {number} after */
  async #ask(after) {
    this.#asked_ms = this.store.now();
    const boot = this.#boot;
    const query = new URLSearchParams(after >= 0 ? { after: String(after) } : {});
    const vehicle = this.store.frame?.vehicle;
    if (vehicle) query.set('vehicle', vehicle);
    const replay = this.store.frame?.replay;
    if (replay) query.set('replay', replay.token);
    try {
      const answer = await fetch(`/api/trends?${query}`, { cache: 'no-store' });
      if (!answer.ok || boot !== this.#boot) return;
      const found = await answer.json();
      if (typeof found?.first === 'number' && typeof found.lowest === 'object') this.minute.take(found, true);
    } catch {
      // asked again after the next gap's time
    }
  }
}

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const trends = new Trends(store);
  const list = field(root, 'sparks');
  const rows = SPECS.map((spec) => {
    const value = html('span', { class: 'n' });
    const label = html('span', {});
    const canvas = /** @type {HTMLCanvasElement} */ (html('canvas', { class: 'spark', 'aria-hidden': 'true' }));
    const key = html('button', { type: 'button', 'aria-haspopup': 'dialog', 'aria-label': `${spec.title}: open the chart of the last minute`, 'data-trend': spec.name }, html('span', { class: 'row' }, label, value), canvas);
    list.append(html('li', {}, key));
    return { spec, value, label, canvas, key };
  });
  /** @type {Palette} */
  let palette = colours(root);
  let isSeen = false;
  let drew_ms = -Infinity;

  const watcher = new IntersectionObserver(([entry]) => {
    isSeen = entry?.isIntersecting ?? false;
    drew_ms = -Infinity;
    if (isSeen) draw();
  });
  watcher.observe(list);
  const themed = () => {
    palette = colours(root);
    drew_ms = -Infinity;
    draw();
  };
  const stops = [
    store.on('draw', draw),
    listen(window, 'catgraph-theme', themed),
    listen(matchMedia('(prefers-color-scheme: light)'), 'change', themed),
    listen(window, 'catgraph-units', themed),
    listen(window, 'resize', themed),
    // The chart and its library are fetched by the first press: most drives need neither.
    ...rows.map(({ spec, key }) => listen(key, 'click', () => {
      import('./chart.js').then((chart) => {
        setText(field(root, 'sparks-says'), 'now at the right');
        return chart.open(spec, trends, store);
      }).catch(() => setText(field(root, 'sparks-says'), 'the chart could not be fetched'));
    })),
  ];

  function draw() {
    if (!isSeen || document.hidden) return;
    for (const row of rows) drawWords(row);
    if (store.now() - drew_ms < DRAW_EVERY_MS) return;
    drew_ms = store.now();
    for (const { spec, canvas } of rows) drawSpark(canvas, spec, trends, store, palette);
  }

  /** @param {typeof rows[number]} row */
  function drawWords({ spec, label, value, key }) {
    const { unit } = shownIn(0, spec.unit);
    const { text, ink } = nowOf(spec, store);
    setText(label, spec.name === 'acceleration' ? spec.label : `${spec.label} ${unit}`); // its unit has no room beside it
    write(value, ink, text);
    setAttribute(key, 'aria-label', `${spec.title}: ${ink === 'stale' ? 'stale, last ' : ''}${text} ${unit}; open the chart of the last minute`);
  }

  draw();
  return () => {
    watcher.disconnect();
    for (const stop of stops) stop();
  };
}

/**
 * What a signal says now, in words and ink.
 * @param {Spec} spec
 * @param {import('../core/store.js').Store} store
 */
export function nowOf(spec, store) {
  const { ink } = store.ink(spec.name);
  if (ink === 'never' || ink === 'not_published') return { ink, text: ABSENT[ink], value: null };
  const said = store.signal(spec.name)?.value;
  const number = said?.['speed_mps'] ?? said?.['acceleration_mps2'] ?? said?.['distance_m'] ?? said?.['percent'];
  const { value } = shownIn(typeof number === 'number' ? number : null, spec.unit);
  const isNone = spec.name === 'distance' && said?.['none_in_range'];
  return { ink, value, text: isNone ? 'none' : (spec.isSigned ? signed : fixed)(value, spec.digits) };
}

/**
 * @param {HTMLCanvasElement} canvas
 * @param {Spec} spec
 * @param {Trends} trends
 * @param {import('../core/store.js').Store} store
 * @param {Palette} palette
 */
function drawSpark(canvas, spec, trends, store, palette) {
  const width = canvas.clientWidth;
  const dpr = window.devicePixelRatio || 1;
  const g = canvas.getContext('2d', { alpha: false });
  if (!width || !g) return;
  const [w, h] = [Math.round(width * dpr), Math.round(HEIGHT * dpr)];
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
  }
  g.setTransform(dpr, 0, 0, dpr, 0, 0);
  g.fillStyle = palette.panel;
  g.fillRect(0, 0, width, HEIGHT);
  const { ink } = store.ink(spec.name);
  if (ink === 'not_published') return;
  const course = trends.course(spec);
  const limits = store.frame?.limits ?? {};
  const [low, high] = spec.ends(limits, course.isEmpty ? 0 : course.low, course.isEmpty ? 0 : course.high);
  const x = (/** @type {number} */ at_s) => width * (1 + at_s / (SPAN * STEP_S));
  const y = (/** @type {number} */ value) => 48 - (44 * (value - low)) / (high - low || 1);
  hatch(g, course.gaps.map(([a, b]) => [x(a), Math.max(x(b) - x(a), 2)]), palette.hatch);
  line(g, palette.line, 1.5, [[0, y(Math.max(low, 0))], [width, y(Math.max(low, 0))]]);
  const limit = spec.limit === null ? null : store.limit(spec.limit);
  if (limit !== null && limit <= high) {
    g.setLineDash([6, 3]);
    line(g, palette.you, 1.5, [[0, y(limit)], [width, y(limit)]]);
    g.setLineDash([]);
  }
  g.strokeStyle = g.fillStyle = palette.ink;
  g.lineWidth = 2;
  g.lineJoin = 'round';
  g.beginPath();
  course.times_s.forEach((at_s, i) => {
    const [a, b] = [course.lowest[i] ?? null, course.highest[i] ?? null];
    if (a === null || b === null) return;
    if (i === 0 || course.lowest[i - 1] === null) g.moveTo(x(at_s), y(a));
    else g.lineTo(x(at_s), y(a));
    if (b !== a) g.lineTo(x(at_s), y(b));
    else if ((course.lowest[i - 1] ?? null) === null && (course.lowest[i + 1] ?? null) === null) g.rect(x(at_s) - 0.5, y(a) - 0.5, 1, 1); // alone
  });
  g.stroke();
}

/** Diagonals over what nobody knows. @param {CanvasRenderingContext2D} g @param {number[][]} bands x and width @param {string} colour */
function hatch(g, bands, colour) {
  if (!bands.length) return;
  g.save();
  g.beginPath();
  for (const [x = 0, width = 0] of bands) g.rect(x, 4, width, 44);
  g.clip();
  g.strokeStyle = colour;
  g.lineWidth = 2.5;
  g.beginPath();
  for (const [x = 0, width = 0] of bands) {
    for (let at = Math.floor((x - 44) / 9) * 9; at < x + width; at += 9) {
      g.moveTo(at, 48);
      g.lineTo(at + 44, 4);
    }
  }
  g.stroke();
  g.restore();
}

/** @param {CanvasRenderingContext2D} g @param {string} colour @param {number} width @param {number[][]} points */
function line(g, colour, width, points) {
  g.strokeStyle = colour;
  g.lineWidth = width;
  g.beginPath();
  for (const [x = 0, y = 0] of points) g.lineTo(x, y);
  g.stroke();
}

/** The style sheet's colours, for a canvas. @param {HTMLElement} root @returns {Palette} */
export function colours(root) {
  const probe = document.createElement('i');
  root.append(probe);
  const found = /** @type {any} */ ({});
  for (const name of COLOURS) {
    probe.className = `probe ${name}`;
    found[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return found;
}
