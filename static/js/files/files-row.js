// One recording in the list: its track, its name, whose it is, length, size and alarms; pressed anywhere it offers what can be done.

import { alarmWords, countsOf, lengthWords, matchWords, nameOf, originWords, pointsOf, sizeWords, storedWords, whenWords } from './files-layout.js';
import { html, icon, listen, svg, textNodes } from '../core/dom.js';
import { NOTHING } from '../core/format.js';

/** @typedef {import('./files-layout.js').Recording} Recording */

const HELD_MS = 500; // a press of this length is a long one
const STILL_PX = 10; // a finger that moves farther scrolls

const MARKS = /** @type {Record<string, [string, string]>} */ ({ critical: ['al', 'M0-5l5 5-5 5-5-5z'], warning: ['aw', 'M0-6.5l6 10.5h-12z'] });
const COLUMNS = /** @type {const} */ (['critical', 'warning']);
const ICONS = /** @type {Record<string, [string, string]>} */ ({ critical: ['crit', 'c-crit'], warning: ['warn', 'c-warn'], advisory: ['info', 'sub'] });

/** The track of the drive, or the text that it is not known. @param {Recording} row */
export function thumbnail(row) {
  const { sketch } = row;
  if (!sketch) {
    const why = row.state === 'unreadable' ? 'not readable' : row.state === 'waiting' ? 'being read' : 'no position';
    return html('span', { class: 'thumb none' }, why);
  }
  return svg('svg', { class: 'thumb', viewBox: '0 0 64 64', 'aria-hidden': 'true' },
    ...sketch.lines.map((line) => svg('polyline', { points: pointsOf(line) })),
    svg('circle', { cx: sketch.start[0], cy: sketch.start[1], r: 3.5 }),
    ...sketch.marks.flatMap(([x, y, priority]) => {
      const mark = MARKS[priority];
      return mark ? [svg('path', { class: mark[0], d: mark[1], transform: `translate(${x} ${y})` })] : [];
    }));
}

/**
 * Its alarms as the strip draws them, each priority in its column; a column of a table that has none of it holds a dash.
 * @param {Recording} row
 */
function counts(row) {
  const found = countsOf(row.alarms);
  if (!found.length) return [html('span', {}, alarmWords(row.alarms))];
  const none = COLUMNS.filter((priority) => !found.some((one) => one.priority === priority)).map((priority) => html('span', { class: 'dash', 'data-priority': priority, 'aria-hidden': 'true' }, NOTHING));
  return [...none, ...found.map(({ priority, count, text }) => {
    const [glyph, kind] = ICONS[priority] ?? ['info', 'sub'];
    return html('span', { class: `mini ${kind}`, 'data-priority': priority }, icon(glyph, 's'),
      ...(priority === 'advisory' ? textNodes(text) // it stands in no column of its own
        : [html('span', { class: 'n b', 'aria-hidden': 'true' }, String(count)), html('span', { class: 'unseen' }, text)]));
  })];
}

/**
 * @param {Recording} row
 * @param {number} now_ms
 * @param {string} text that was searched for
 * @param {(row: Recording, from: HTMLElement) => void} onPress
 * @returns {HTMLElement}
 */
export function drawRow(row, now_ms, text, onPress) {
  const name = nameOf(row, now_ms);
  const more = html('button', { type: 'button', class: 'btn', 'aria-label': `Actions for ${name}`, 'aria-haspopup': 'dialog' }, icon('menu', 'dots'));
  const length = row.state === 'read' ? html('span', {}, ...textNodes(lengthWords(row.length_s))) : html('span', { class: 'dash', 'aria-hidden': 'true' }, NOTHING);
  const last = row.state === 'read' ? html('span', { class: 'counts' }, ...counts(row)) : html('span', { class: 'why' }, ...textNodes(row.state === 'waiting' ? 'being read' : row.problem ?? 'not readable'));
  const tags = row.tags.length ? [html('div', { class: 'm tags' }, ...row.tags.map((tag) => html('bdi', { class: 'file-tag' }, tag)))] : [];
  const stored = row.stored ? [html('div', { class: 'm stored', 'data-state': row.stored.state }, ...textNodes(storedWords(row.stored)))] : [];
  const when = row.title ? [html('span', { class: 'when' }, whenWords(row.started_ms, now_ms))] : [];
  const matched = matchWords(row, text);
  const found = matched ? [html('bdi', { class: 'm matched' }, ...textNodes(matched))] : [];
  const item = html('li', { class: 'file', 'data-id': row.id, 'data-state': row.state }, thumbnail(row),
    html('div', { class: 'tx' }, html('div', { class: 't', dir: 'auto' }, name), html('div', { class: 'm origin' }, ...when, html('span', {}, originWords(row, now_ms))), html('div', { class: 'm facts-line' }, length, html('span', {}, ...textNodes(sizeWords(row.size_bytes))), last), ...stored, ...tags, ...found),
    more);
  pressed(item, () => onPress(row, more));
  return item;
}

/** The finger that still lies there must not press what has come under it: its click goes nowhere. */
function swallow() {
  const stop = (/** @type {Event} */ event) => {
    event.preventDefault();
    event.stopPropagation();
  };
  const leave = () => setTimeout(() => window.removeEventListener('click', stop, { capture: true }), 100);
  window.addEventListener('click', stop, { capture: true });
  for (const type of ['pointerup', 'pointercancel']) window.addEventListener(type, leave, { capture: true, once: true });
}

/**
 * A short press, a long one and the right button of a mouse do the same; each is one press.
 * @param {HTMLElement} item
 * @param {() => void} act
 */
export function pressed(item, act) {
  /** @type {{x: number, y: number} | null} */
  let began = null;
  let isDone = false;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;
  const end = () => {
    clearTimeout(timer);
    began = null;
  };
  const once = () => {
    end();
    if (isDone) return;
    isDone = true;
    act();
  };
  listen(item, 'pointerdown', (event) => {
    isDone = false;
    if (event.button !== 0) return;
    began = { x: event.clientX, y: event.clientY };
    timer = setTimeout(() => {
      once();
      swallow();
    }, HELD_MS);
  });
  listen(item, 'pointermove', (event) => {
    if (began && Math.hypot(event.clientX - began.x, event.clientY - began.y) > STILL_PX) end();
  });
  for (const type of ['pointerup', 'pointercancel', 'pointerleave']) listen(item, type, end);
  listen(item, 'contextmenu', (event) => {
    event.preventDefault();
    once();
  });
  listen(item, 'click', (event) => {
    if (event.detail === 0) isDone = false; // a key: no finger went down before it
    once();
  });
}
