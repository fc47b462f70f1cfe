// The list of alarms behind the strip: every one that stands, has returned, is shelved or suppressed, with its keys.

import { latelyWords, noneWords, together } from './alarm-pages.js';
import { countWords, rowsOf } from './alarms-layout.js';
import { html, icon, listen, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { write } from '../core/ink.js';
import { cameAt, Meant } from '../core/meant.js';
import { openScreen } from '../core/open-screen.js';
import { PagedList } from './pager.js';
import { openShelve } from './shelve.js';
import { loadWords } from './standing.js';
import { speedUnit, speedWords } from '../core/units.js';

/**
 * @typedef {import('./alarms-layout.js').Row} Row
 * @typedef {import('../core/protocol-types.js').StandingAlarm} Alarm
 * @typedef {{element: HTMLElement, detail: HTMLElement, state: HTMLElement, meant: Meant, place: number}} Drawn
 */

const LABELS = { silence: 'Silence', acknowledge: 'Acknowledge', shelve: 'Shelve', unshelve: 'Unshelve', take_alarm: 'Take over' };

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @param {{close?: () => void, inHead?: () => string | null}} [where] close: it stands alone and can be closed; inHead: id and occurrence of the alarm that stands above the list
 */
export function mount(root, store, { close, inHead = () => null } = {}) {
  const list = new AlarmList(root, store, close !== undefined, inHead);
  list.draw();
  const stops = [
    store.on('draw', () => list.draw()),
    listen(list.parts.ended, 'click', (event) => list.acknowledgeEnded(event)),
    listen(list.parts.these, 'click', (event) => list.acknowledgeThese(event)),
    ...(close ? [listen(list.parts.close, 'click', close)] : []),
  ];
  return () => {
    stops.forEach((stop) => stop());
    list.pager.stop();
    root.replaceChildren();
  };
}

class AlarmList {
  /** @type {Map<string, Drawn>} */
  #drawn = new Map();
  #texts = '';
  #order = '';
  /** @type {Row[]} */
  #rows = [];
  /** @type {Meant} */
  #ended;
  /** Since when each row is in sight, by its key [ms]. @type {Map<string, number>} */
  #since = new Map();
  /** What "Acknowledge all that ended" stands for, by their keys. @type {string[]} */
  #returned = [];

  /** @param {HTMLElement} root @param {import('../core/store.js').Store} store @param {boolean} isAlone @param {() => string | null} inHead */
  constructor(root, store, isAlone, inHead) {
    this.store = store;
    this.inHead = inHead;
    this.parts = build(root);
    this.#ended = new Meant(this.parts.ended);
    show(this.parts.close, isAlone);
    this.pager = new PagedList(this.parts.list, () => this.#turned());
    this.parts.foot.append(this.pager.element);
  }

  get mayAct() {
    const { store } = this;
    return !store.isViewer && !store.replaying && !store.isSilent;
  }

  /** @param {Event} event */
  acknowledgeEnded(event) {
    if (!this.#ended.by(event)) return;
    for (const { kind, alarm } of this.#rows) if (kind === 'returned' && alarm) void this.#command('acknowledge', alarm);
  }

  /** @param {Event} event */
  acknowledgeThese(event) {
    const { alarms, isReady } = this.#together(performance.now() - cameAt(event));
    if (isReady) for (const alarm of alarms) void this.#command('acknowledge', alarm);
  }

  draw() {
    const { store, mayAct } = this;
    const { count, speed, unit, load, note, none, lately } = this.parts;
    const { frame } = store;
    const head = this.inHead();
    const rows = frame ? rowsOf(frame.alarms, frame.suppressed ?? [], mayAct) : [];
    this.#rows = head === null ? rows : rows.filter(({ alarm }) => !alarm || `${alarm.id} ${alarm.occurrence}` !== head);
    this.pager.above = rows.length - this.#rows.length;
    this.#drawRows(mayAct);
    const { ink } = store.ink('speed');
    const speed_mps = store.signal('speed')?.value?.speed_mps;
    const isKnown = typeof speed_mps === 'number';
    write(speed, ink, isKnown ? speedWords(speed_mps)[0] ?? '–' : '–', unit, isKnown ? speedUnit() : '');
    setSentence(count, countWords(rows));
    setSentence(load, loadWords(frame?.alarm_load));
    setText(note, rows.length ? whyNoKeys(store) : ''); // an empty list says it
    show(none, rows.length === 0);
    setText(none, noneWords({
      isSilent: store.isSilent, isReplay: store.replaying, isPaused: frame?.session.paused === true,
      isChecked: frame?.replay ? frame.replay.silent_s !== null : store.chain.state === 'Live',
    }));
    const isQuiet = !store.isSilent && !store.replaying && !rows.some(({ kind }) => kind === 'unacknowledged' || kind === 'returned');
    setSentence(lately, isQuiet ? latelyWords(store.log.rows, frame?.alarm_load?.in_10_min) : '');
    this.#drawFoot(mayAct);
  }

  /** @param {boolean} mayAct */
  #drawFoot(mayAct) {
    const { ended, these } = this.parts;
    const returned = this.#rows.filter(({ kind }) => kind === 'returned').map(({ key }) => key);
    if (returned.some((key) => !this.#returned.includes(key))) this.#ended.moved();
    this.#returned = returned;
    setSentence(ended, `Acknowledge all that ended${returned.length ? ` (${returned.length})` : ''}`);
    show(ended, !this.store.replaying);
    setAttribute(ended, 'disabled', !mayAct || returned.length === 0);
    const { alarms, isReady } = this.#together();
    show(these, mayAct && alarms.length > 1);
    setSentence(these, `Acknowledge these ${alarms.length}`);
    setAttribute(these, 'disabled', !isReady);
  }

  /** @param {number} [ago_ms] as of then */
  #together(ago_ms = 0) {
    const [from, to] = this.pager.shown;
    return together(this.#rows.slice(from, to), this.#since, this.store.now() - ago_ms);
  }

  /** Another page is shown, or other rows: what came in sight begins to be looked at. */
  #turned() {
    const shown = this.#rows.slice(...this.pager.shown).map(({ key }) => key);
    for (const key of [...this.#since.keys()]) if (!shown.includes(key)) this.#since.delete(key);
    for (const key of shown) if (!this.#since.has(key)) this.#since.set(key, this.store.now());
    this.#drawFoot(this.mayAct);
  }

  /** Keeps the elements of rows that stay, so that a key does not vanish under a finger. @param {boolean} mayAct */
  #drawRows(mayAct) {
    const drawn = this.#drawn;
    const keyed = new Map(this.#rows.map((row) => [`${mayAct} ${row.key} ${row.keys.join()} ${row.silent}`, row]));
    const order = [mayAct, ...keyed.keys()].join('|');
    const isOther = order !== this.#order;
    if (isOther) {
      for (const name of [...drawn.keys()]) if (!keyed.has(name)) drawn.delete(name);
      for (const [name, row] of keyed) if (!drawn.has(name)) drawn.set(name, this.#build(row));
      this.parts.list.replaceChildren(...[...keyed.keys()].map((name) => /** @type {Drawn} */ (drawn.get(name)).element));
      this.#order = order;
      [...keyed.keys()].forEach((name, place) => {
        const at = /** @type {Drawn} */ (drawn.get(name));
        if (at.place !== place) at.meant.moved();
        at.place = place;
      });
    }
    for (const [name, row] of keyed) {
      const at = drawn.get(name);
      if (!at) continue;
      setSentence(at.detail, row.detail);
      setSentence(at.state, row.state);
    }
    const texts = this.#rows.map(({ detail, state }) => `${detail} ${state}`).join('|').replace(/[0-9]/g, '0'); // all digits have one width
    if (isOther) this.pager.lay();
    else if (texts !== this.#texts) this.pager.look();
    this.#texts = texts;
  }

  /** @param {Row} row @returns {Drawn} */
  #build(row) {
    const [detail, state] = [html('span', { class: 'm' }), html('span', { class: 's' })];
    const meant = new Meant();
    const keys = row.keys.map((name) => {
      const key = html('button', { type: 'button', class: name === 'acknowledge' ? 'key solid' : 'key', 'data-do': name }, LABELS[name]);
      key.setAttribute('aria-label', `${LABELS[name]}: ${row.title}`);
      key.addEventListener('click', (event) => {
        const { alarm } = row;
        if (!alarm || (event.detail !== 0 && !meant.by(event))) return; // a key with the focus keeps it wherever it moves
        if (name === 'shelve') openShelve(this.store, alarm, (sentence) => setSentence(this.parts.message, sentence));
        else void this.#command(name, alarm);
      });
      return key;
    });
    const mark = html('span', { class: 'mark' }, icon(row.icon));
    const isWaiting = row.kind === 'unacknowledged' || row.kind === 'returned';
    const title = html('span', { class: 't' }, row.title);
    const at = html('span', { class: 'h' }, isWaiting || !row.at ? '' : 'began ', html('span', { class: 'n' }, row.at));
    const text = html('button', { type: 'button', class: 'tx', 'data-f': 'open' }, ...(isWaiting ? [html('span', {}, title, at), html('span', {}, detail, state)]
      : [html('span', {}, title), html('span', {}, detail), html('span', { class: 'l3' }, state, at)]));
    text.addEventListener('click', () => openScreen('check', row.id));
    const silent = html('span', { class: 'quiet' });
    setSentence(silent, row.silent);
    const answers = [...(row.silent ? [silent] : []), ...keys];
    const element = html('li', { 'data-kind': row.kind, 'data-priority': row.priority, 'data-waits': isWaiting }, mark, text,
      ...(answers.length ? [html('div', { class: 'ac' }, ...answers)] : []));
    meant.element = element;
    return { element, detail, state, meant, place: -1 };
  }

  /** @param {'acknowledge' | 'silence' | 'unshelve' | 'take_alarm'} kind @param {Alarm} alarm */
  async #command(kind, alarm) {
    setSentence(this.parts.message, '');
    const answer = await this.store.ask(kind, { alarm: alarm.id, ...(kind === 'unshelve' ? {} : { occurrence: alarm.occurrence }) });
    if (!answer.ok) setSentence(this.parts.message, answer.reason ?? 'Refused.');
  }
}

/** Builds the parts of the list in `root`. @param {HTMLElement} root */
function build(root) {
  const count = html('span', { 'data-f': 'alarms-count' });
  const [speed, unit] = [html('span', { class: 'n v' }), html('span', { class: 'u' })];
  const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close the list', 'data-f': 'close' }, icon('close'));
  const load = html('p', { class: 'sec', 'data-f': 'load' });
  const note = html('p', { class: 'sec', 'data-f': 'alarms-note' });
  const list = html('ul', { class: 'alarms', 'data-f': 'alarms' });
  const none = html('p', { class: 'state', 'data-f': 'alarms-none' });
  const lately = html('p', { class: 'lately', 'data-f': 'alarms-lately' });
  const message = html('p', { class: 'note-line bad', role: 'alert', 'data-f': 'alarms-message' });
  const ended = html('button', { type: 'button', class: 'key', 'data-f': 'alarms-ended' });
  const these = html('button', { type: 'button', class: 'key', 'data-f': 'alarms-these', hidden: true });
  const foot = html('div', { class: 'alarms-foot' }, ended, these);
  root.replaceChildren(html('div', { class: 'alarm-list' },
    html('div', { class: 'alarms-head' }, html('h2', { tabindex: -1 }, 'Alarms'), count,
      html('span', { class: 'alarms-speed', 'aria-label': 'Speed' }, speed, unit),
      html('button', { type: 'button', class: 'btn', 'aria-label': 'Alarm log', 'data-screen': 'log' }, icon('clock')), close),
    load, note, none, list, lately, message, foot));
  return { count, speed, unit, close, load, note, list, none, lately, message, ended, these, foot };
}

/** Why nothing can be acknowledged here now; empty where it can. @param {import('../core/store.js').Store} store */
function whyNoKeys(store) {
  if (store.isSilent) return 'The server does not answer: nothing can be acknowledged now.';
  if (store.replaying) return 'A recording is shown: nothing can be acknowledged in it.';
  if (store.isViewer) return 'A viewer cannot acknowledge.';
  return store.frame?.session.paused ? 'Paused: the alarms of the car are suppressed until Resume.' : '';
}
