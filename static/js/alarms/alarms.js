// The list of alarms behind the strip: every one that stands, has returned, is shelved or suppressed, with its keys.

import { countWords, noneWords, rowsOf } from './alarms-layout.js';
import { html, icon, listen, setAttribute, setText, setWords, show } from '../core/dom.js';
import { write } from '../core/ink.js';
import { openShelve } from './shelve.js';
import { loadWords } from './standing.js';
import { speedUnit, speedWords } from '../core/units.js';

/**
 * @typedef {import('./alarms-layout.js').Row} Row
 * @typedef {{element: HTMLElement, words: HTMLElement, state: HTMLElement}} Drawn
 */

const LABELS = { acknowledge: 'Acknowledge', shelve: 'Shelve', unshelve: 'Unshelve' };

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const count = html('b', { 'data-f': 'alarms-count' });
  const [speed, unit] = [html('span', { class: 'n v' }), html('span', { class: 'u' })];
  const load = html('p', { class: 'sec', 'data-f': 'load' });
  const note = html('p', { class: 'sec', 'data-f': 'alarms-note' });
  const list = html('ul', { class: 'alarms', 'data-f': 'alarms' });
  const none = html('p', { class: 'state', 'data-f': 'alarms-none' });
  const says = html('p', { class: 'note-line bad', role: 'alert', 'data-f': 'alarms-says' });
  const ended = html('button', { type: 'button', class: 'key wide', 'data-f': 'alarms-ended' });
  root.replaceChildren(
    html('div', { class: 'alarms-head' }, count, html('span', { class: 'alarms-speed', 'aria-label': 'Speed' }, speed, unit)), load, note, none, list, says,
    html('div', { class: 'alarms-foot' }, ended, html('button', { type: 'button', class: 'key wide', 'data-screen': 'log' }, 'Alarm log')));
  /** @type {Map<string, Drawn>} */
  const drawn = new Map();
  let order = '';
  /** @type {Row[]} */
  let rows = [];

  const stops = [
    store.on('draw', draw),
    listen(ended, 'click', () => { for (const { kind, alarm } of rows) if (kind === 'returned' && alarm) void ask('acknowledge', alarm); }),
  ];

  /** @param {'acknowledge' | 'unshelve'} kind @param {import('../core/protocol.js').Alarm} alarm */
  async function ask(kind, alarm) {
    setWords(says, '');
    const answer = await store.ask(kind, { alarm: alarm.id, ...(kind === 'acknowledge' ? { occurrence: alarm.occurrence } : {}) });
    if (!answer.ok) setWords(says, answer.reason ?? 'Refused.');
  }

  /** @param {Row} row @returns {Drawn} */
  function drawRow(row) {
    const [words, state] = [html('span', { class: 'm' }), html('span', { class: 's' })];
    const keys = row.keys.map((name) => {
      const key = html('button', { type: 'button', class: name === 'acknowledge' ? 'key solid' : 'key', 'data-do': name }, LABELS[name]);
      key.setAttribute('aria-label', `${LABELS[name]}: ${row.title}`);
      key.addEventListener('click', () => {
        const { alarm } = row;
        if (!alarm) return;
        if (name === 'shelve') openShelve(store, alarm, (sentence) => setWords(says, sentence));
        else void ask(name, alarm);
      });
      return key;
    });
    const mark = html('span', { class: 'mark' }, icon(row.icon));
    const isWaiting = row.kind === 'unacknowledged' || row.kind === 'returned';
    const element = html('li', { 'data-kind': row.kind, 'data-priority': row.priority, 'data-wide': isWaiting && keys.length > 0 }, mark, html('span', { class: 't' }, row.title),
      html('span', { class: 'n h' }, row.at), words, state, ...(keys.length ? [html('div', { class: 'ac' }, ...keys)] : []));
    return { element, words, state };
  }

  function draw() {
    const { frame } = store;
    const mayAct = !store.isViewer && !store.replaying && !store.isSilent;
    rows = frame ? rowsOf(frame.alarms, frame.suppressed ?? [], mayAct) : [];
    const wanted = `${mayAct} ${rows.map(({ key, keys }) => `${key} ${keys.join()}`).join('|')}`;
    if (wanted !== order) {
      const kept = new Map(rows.map((row) => [`${mayAct} ${row.key} ${row.keys.join()}`, row]));
      for (const name of [...drawn.keys()]) if (!kept.has(name)) drawn.delete(name);
      for (const [name, row] of kept) if (!drawn.has(name)) drawn.set(name, drawRow(row));
      list.replaceChildren(...[...kept.keys()].map((name) => /** @type {Drawn} */ (drawn.get(name)).element));
      order = wanted;
    }
    for (const row of rows) {
      const at = drawn.get(`${mayAct} ${row.key} ${row.keys.join()}`);
      if (!at) continue;
      setWords(at.words, row.words);
      setWords(at.state, row.state);
    }
    const { ink } = store.ink('speed');
    const speed_mps = store.signal('speed')?.value?.speed_mps;
    const isKnown = typeof speed_mps === 'number';
    write(speed, ink, isKnown ? speedWords(speed_mps)[0] ?? '–' : '–', unit, isKnown ? speedUnit() : '');
    setWords(count, countWords(rows));
    setWords(load, loadWords(frame?.alarm_load));
    const why = store.isSilent ? 'The server does not answer: nothing can be acknowledged now.' : store.replaying ? 'A recording is shown: nothing can be acknowledged in it.'
      : store.isViewer ? 'A viewer cannot acknowledge.' : frame?.session.paused ? 'Paused: the alarms of the car are suppressed until Resume.' : '';
    setText(note, rows.length || frame?.session.paused ? why : '');
    show(none, rows.length === 0);
    setText(none, noneWords({
      isSilent: store.isSilent, isReplay: store.replaying, isPaused: frame?.session.paused === true,
      isChecked: frame?.replay ? frame.replay.silent_s !== null : store.chain.word === 'Live',
    }));
    const returned = rows.filter(({ kind }) => kind === 'returned').length;
    setWords(ended, `Acknowledge all that ended${returned ? ` ${returned}` : ''}`);
    setAttribute(ended, 'disabled', !mayAct || returned === 0);
  }

  draw();
  return () => {
    stops.forEach((stop) => stop());
    root.replaceChildren();
  };
}
