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
  const list = new AlarmList(root, store);
  list.draw();
  const stops = [store.on('draw', () => list.draw()), listen(list.parts.ended, 'click', () => list.acknowledgeEnded())];
  return () => {
    stops.forEach((stop) => stop());
    root.replaceChildren();
  };
}

class AlarmList {
  /** @type {Map<string, Drawn>} */
  #drawn = new Map();
  #order = '';
  /** @type {Row[]} */
  #rows = [];

  /** @param {HTMLElement} root @param {import('../core/store.js').Store} store */
  constructor(root, store) {
    this.store = store;
    this.parts = build(root);
  }

  acknowledgeEnded() {
    for (const { kind, alarm } of this.#rows) if (kind === 'returned' && alarm) void this.#command('acknowledge', alarm);
  }

  draw() {
    const { store } = this;
    const { count, speed, unit, load, note, none, ended } = this.parts;
    const { frame } = store;
    const mayAct = !store.isViewer && !store.replaying && !store.isSilent;
    this.#rows = frame ? rowsOf(frame.alarms, frame.suppressed ?? [], mayAct) : [];
    this.#drawRows(mayAct);
    const { ink } = store.ink('speed');
    const speed_mps = store.signal('speed')?.value?.speed_mps;
    const isKnown = typeof speed_mps === 'number';
    write(speed, ink, isKnown ? speedWords(speed_mps)[0] ?? '–' : '–', unit, isKnown ? speedUnit() : '');
    setWords(count, countWords(this.#rows));
    setWords(load, loadWords(frame?.alarm_load));
    setText(note, this.#rows.length || frame?.session.paused ? whyNoKeys(store) : '');
    show(none, this.#rows.length === 0);
    setText(none, noneWords({
      isSilent: store.isSilent, isReplay: store.replaying, isPaused: frame?.session.paused === true,
      isChecked: frame?.replay ? frame.replay.silent_s !== null : store.chain.word === 'Live',
    }));
    const returned = this.#rows.filter(({ kind }) => kind === 'returned').length;
    setWords(ended, `Acknowledge all that ended${returned ? ` ${returned}` : ''}`);
    setAttribute(ended, 'disabled', !mayAct || returned === 0);
  }

  /** Keeps the elements of rows that stay, so that a key does not vanish under a finger. @param {boolean} mayAct */
  #drawRows(mayAct) {
    const drawn = this.#drawn;
    const keyed = new Map(this.#rows.map((row) => [`${mayAct} ${row.key} ${row.keys.join()}`, row]));
    const order = [mayAct, ...keyed.keys()].join('|');
    if (order !== this.#order) {
      for (const name of [...drawn.keys()]) if (!keyed.has(name)) drawn.delete(name);
      for (const [name, row] of keyed) if (!drawn.has(name)) drawn.set(name, this.#build(row));
      this.parts.list.replaceChildren(...[...keyed.keys()].map((name) => /** @type {Drawn} */ (drawn.get(name)).element));
      this.#order = order;
    }
    for (const [name, row] of keyed) {
      const at = drawn.get(name);
      if (!at) continue;
      setWords(at.words, row.words);
      setWords(at.state, row.state);
    }
  }

  /** @param {Row} row @returns {Drawn} */
  #build(row) {
    const [words, state] = [html('span', { class: 'm' }), html('span', { class: 's' })];
    const keys = row.keys.map((name) => {
      const key = html('button', { type: 'button', class: name === 'acknowledge' ? 'key solid' : 'key', 'data-do': name }, LABELS[name]);
      key.setAttribute('aria-label', `${LABELS[name]}: ${row.title}`);
      key.addEventListener('click', () => {
        const { alarm } = row;
        if (!alarm) return;
        if (name === 'shelve') openShelve(this.store, alarm, (sentence) => setWords(this.parts.says, sentence));
        else void this.#command(name, alarm);
      });
      return key;
    });
    const mark = html('span', { class: 'mark' }, icon(row.icon));
    const isWaiting = row.kind === 'unacknowledged' || row.kind === 'returned';
    const element = html('li', { 'data-kind': row.kind, 'data-priority': row.priority, 'data-wide': isWaiting && keys.length > 0 }, mark, html('span', { class: 't' }, row.title),
      html('span', { class: 'n h' }, row.at), words, state, ...(keys.length ? [html('div', { class: 'ac' }, ...keys)] : []));
    return { element, words, state };
  }

  /** @param {'acknowledge' | 'unshelve'} kind @param {import('../core/protocol.js').Alarm} alarm */
  async #command(kind, alarm) {
    setWords(this.parts.says, '');
    const answer = await this.store.ask(kind, { alarm: alarm.id, ...(kind === 'acknowledge' ? { occurrence: alarm.occurrence } : {}) });
    if (!answer.ok) setWords(this.parts.says, answer.reason ?? 'Refused.');
  }
}

/** Builds the parts of the list in `root`. @param {HTMLElement} root */
function build(root) {
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
  return { count, speed, unit, load, note, list, none, says, ended };
}

/** Why nothing can be acknowledged here now; empty where it can. @param {import('../core/store.js').Store} store */
function whyNoKeys(store) {
  if (store.isSilent) return 'The server does not answer: nothing can be acknowledged now.';
  if (store.replaying) return 'A recording is shown: nothing can be acknowledged in it.';
  if (store.isViewer) return 'A viewer cannot acknowledge.';
  return store.frame?.session.paused ? 'Paused: the alarms of the car are suppressed until Resume.' : '';
}
