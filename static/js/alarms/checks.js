// One tile a check: OK, FAULT, or not checked and why.

import { tilesOf } from './alarm-layout.js';
import { field, html, icon, setAttribute, setIcon, setText, setWords } from '../core/dom.js';

/**
 * @typedef {import('../core/protocol.js').State} State
 * @typedef {{label: string, kind: 'ok' | 'unk' | 'crit' | 'warn' | 'info', icon: string, lines: string[]}} Shown
 */

/**
 * What the tiles show. While the values are not live nothing is checked, whatever the frame says; nor while paused, but
 * for the faults that the server finds all the same: those of the link, and a pause that lasts too long.
 * @param {State} frame
 * @param {string | null} why why nothing is checked, or null
 * @param {boolean} isFuelPublished
 * @returns {Shown[]}
 */
export function showTiles(frame, why, isFuelPublished) {
  const priorities = new Map(frame.alarms.map((alarm) => [alarm.id, alarm.priority]));
  const shown = tilesOf(frame.checks).map(({ label, verdict, brief, ids }) => {
    if (why !== null && !(why === 'paused' && verdict === 'fault')) return tile(label, 'unk', `not checked: ${why}`);
    if (verdict === 'ok') return tile(label, 'ok', brief || 'OK');
    if (verdict === 'unknown') return tile(label, 'unk', brief || 'not checked');
    const found = ids.map((id) => priorities.get(id));
    const kind = found.includes('critical') ? 'crit' : found.includes('advisory') && !found.includes('warning') ? 'info' : 'warn';
    return tile(label, kind, brief || 'FAULT');
  });
  if (!isFuelPublished && !shown.some(({ label }) => label === 'Fuel')) shown.push(tile('Fuel', 'unk', 'not published'));
  return shown;
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
  const count = field(root, 'count');

  function draw() {
    const { frame } = store;
    if (!frame) return;
    const why = store.isSilent ? 'stale' : frame.session.phase !== 'monitoring' ? 'no link' : frame.session.paused ? 'paused'
      : store.chain.cut !== null ? 'stale' : null;
    const shown = showTiles(frame, why, store.ink('fuel').ink !== 'not_published');
    while (list.children.length > shown.length) list.lastElementChild?.remove();
    while (list.children.length < shown.length) list.append(html('li', {}, icon('ok', 's'), html('b'), html('span')));
    shown.forEach((one, i) => write(/** @type {HTMLElement} */ (list.children[i]), one));
    setWords(count, `${shown.filter(({ kind }) => kind === 'ok').length} OK of ${shown.length}`);
  }

  draw();
  return store.on('draw', draw);
}

/**
 * @param {HTMLElement} row
 * @param {Shown} shown
 */
function write(row, { label, kind, icon: glyph, lines }) {
  const [mark, name, brief] = row.children;
  if (!mark || !name || !brief) return;
  setAttribute(row, 'class', kind);
  setAttribute(mark, 'class', kind === 'unk' ? 'i s dashed' : 'i s');
  setIcon(mark, glyph);
  setText(name, label);
  setWords(brief, lines.join('\n'));
}
