// The checks on Home: a row of marks in fixed places, and a tile each that shows OK, FAULT, or not checked and why. Each opens.

import { tilesOf } from './alarm-layout.js';
import { field, html, icon, listen, setAttribute, setIcon, setText, setSentence } from '../core/dom.js';
import { openScreen } from '../core/open-screen.js';

/**
 * @typedef {import('../core/protocol-types.js').State} State
 * @typedef {{label: string, kind: 'ok' | 'unk' | 'crit' | 'warn' | 'info', icon: string, lines: string[]}} Shown
 */

/**
 * What the tiles show. While the values are not live nothing is checked, whatever the frame states; nor while paused, except
 * for the faults that the server finds all the same: those of the link, and a pause that lasts too long.
 * @param {State} frame
 * @param {string | null} why why nothing is checked, or null
 * @param {boolean} isFuelPublished
 * @returns {Shown[]}
 */
export function showTiles(frame, why, isFuelPublished, isOld = false) {
  const priorities = new Map(frame.alarms.map((alarm) => [alarm.id, alarm.priority]));
  const shown = tilesOf(frame.checks).map(({ label, verdict, brief, ids }) => {
    if (why !== null && !(why === 'paused' && verdict === 'fault')) return tile(label, 'unk', `not checked: ${why}`);
    if (verdict === 'ok') return isOld ? tile(label, 'unk', 'not checked: stale') : tile(label, 'ok', brief || 'OK');
    if (verdict === 'unknown') return tile(label, 'unk', brief || 'not checked');
    const found = ids.map((id) => priorities.get(id));
    const kind = found.includes('critical') ? 'crit' : found.includes('advisory') && !found.includes('warning') ? 'info' : 'warn';
    return tile(label, kind, brief || 'FAULT');
  });
  if (!isFuelPublished && !shown.some(({ label }) => label === 'Fuel')) shown.push(tile('Fuel', 'unk', 'not published'));
  return shown;
}

/** So far from the middle of a mark that is not OK a finger may be [px]. */
const REACH = 24;

/**
 * Which mark a finger means on a row of small ones: what is not OK draws it from farther.
 * @param {number} at_px of the finger, from the left end of the row
 * @param {('ok' | string)[]} kinds of the marks
 * @param {number} width of a mark
 */
export function markAt(at_px, kinds, width) {
  const far = (/** @type {number} */ i) => Math.abs((i + 0.5) * width - at_px);
  const near = kinds.flatMap((kind, i) => (kind !== 'ok' && far(i) <= REACH ? [i] : [])).sort((a, b) => far(a) - far(b));
  return near[0] ?? Math.min(kinds.length - 1, Math.max(0, Math.floor(at_px / width)));
}

const ICONS = { ok: 'ok', unk: 'unknown', crit: 'crit', warn: 'warn', info: 'info' };

/**
 * @param {string} label
 * @param {Shown['kind']} kind
 * @param {string} brief
 * @returns {Shown}
 */
function tile(label, kind, brief) {
  const split = kind === 'unk' ? brief.indexOf(': ') : -1;
  return { label, kind, icon: ICONS[kind], lines: split < 0 ? [brief] : [brief.slice(0, split), brief.slice(split + 2)] };
}

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const list = field(root, 'tiles');
  const marks = field(root, 'marks');
  const count = field(root, 'count');
  /** @type {Shown[]} */
  let shown = [];

  function draw() {
    const { frame } = store;
    if (!frame) return;
    shown = showTiles(frame, whyUnchecked(store), store.ink('fuel').ink !== 'not_published', hasAged(store));
    while (list.children.length > shown.length) list.lastElementChild?.remove();
    while (list.children.length < shown.length) list.append(html('li', {}, html('button', { type: 'button' }, icon('ok', 's'), html('b'), html('span'))));
    while (marks.children.length > shown.length) marks.lastElementChild?.remove();
    while (marks.children.length < shown.length) marks.append(html('span', {}, icon('ok')));
    shown.forEach((one, i) => {
      write(/** @type {HTMLElement} */ (list.children[i]), one);
      writeMark(/** @type {HTMLElement} */ (marks.children[i]), one);
    });
    setSentence(count, countWords(shown));
    setAttribute(marks, 'aria-label', `Checks: ${countWords(shown)}`);
  }

  /** @param {number} at */
  const open = (at) => {
    const one = shown[at];
    if (one && store.frame?.checks.some(({ label }) => label === one.label)) openScreen('check', `tile:${one.label}`);
  };
  const stops = [
    store.on('draw', draw),
    listen(list, 'click', (event) => open([...list.children].indexOf(event.target.closest('li')))),
    // The marks are smaller than a finger: the nearest that is not OK is meant. By key and for readers there are the tiles.
    listen(marks, 'click', (event) => {
      const { left, width } = marks.getBoundingClientRect();
      open(markAt(event.clientX - left, shown.map(({ kind }) => kind), width / Math.max(1, shown.length)));
    }),
  ];
  draw();
  return () => stops.forEach((stop) => stop());
}

/** Why nothing is checked now; null: it is. @param {import('../core/store.js').Store} store */
export function whyUnchecked(store) {
  if (store.isSilent) return 'stale';
  const session = store.frame?.session;
  if (session?.phase !== 'monitoring') return 'no link';
  if (session.paused) return 'paused';
  return store.chain.cut !== null ? 'stale' : null;
}

/** Whether a value has become stale since the newest frame: it was checked before, and what was OK may not be. @param {import('../core/store.js').Store} store */
export function hasAged(store) {
  return Object.entries(store.frame?.signals ?? {}).some(([name, { freshness }]) => freshness !== 'stale' && store.ink(name).ink === 'stale');
}

/** "20 OK · 1 fault · 4 not checked". @param {Shown[]} shown */
export function countWords(shown) {
  const of = (/** @type {(kind: Shown['kind']) => boolean} */ is) => shown.filter(({ kind }) => is(kind)).length;
  const [ok, unknown] = [of((kind) => kind === 'ok'), of((kind) => kind === 'unk')];
  const faults = shown.length - ok - unknown;
  return [`${ok} OK`, faults ? `${faults} ${faults === 1 ? 'fault' : 'faults'}` : '', unknown ? `${unknown} not checked` : ''].filter(Boolean).join(' · ');
}

/** @param {HTMLElement} place @param {Shown} shown */
function writeMark(place, { kind, icon: glyph }) {
  const mark = place.firstElementChild;
  if (!mark) return;
  setAttribute(place, 'class', kind);
  setAttribute(mark, 'class', kind === 'unk' ? 'i dashed' : 'i');
  setIcon(mark, glyph);
}

/**
 * @param {HTMLElement} row
 * @param {Shown} shown
 */
function write(row, { label, kind, icon: glyph, lines }) {
  const [mark, name, brief] = row.firstElementChild?.children ?? [];
  if (!mark || !name || !brief) return;
  setAttribute(row, 'class', kind);
  setAttribute(mark, 'class', kind === 'unk' ? 'i s dashed' : 'i s');
  setIcon(mark, glyph);
  setText(name, label);
  setSentence(brief, lines.join('\n'));
}
