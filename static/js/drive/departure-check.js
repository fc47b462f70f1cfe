// The departure check of this drive: worked through, and signed. Requested from the server while it is open.

import { countWords, doneOf, leftWords, nextOf, rowsOf, shortHash } from './departure-layout.js';
import { DueItems } from './due.js';
import { Row } from './departure-rows.js';
import { styled } from '../core/style-sheet.js';
import { openWhy } from './departure-why.js';
import { openDuty } from '../control/duty.js';
import { request, sentenceOf } from '../control/request.js';
import { field, html, icon, listen, need, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { timeOfDay } from '../core/format.js';
import { Meant } from '../core/meant.js';
import { openScreen } from '../core/open-screen.js';

/**
 * @typedef {import('./departure-layout.js').Departure} Departure
 * @typedef {import('./departure-layout.js').Item} Item
 */

/** How often it is requested [ms]; while a pedal is looked at, oftener. */
const EVERY_MS = 500;
const EVERY_NOW_MS = 200;
/** An answer that takes longer is none [ms]: what stands there is old. */
const ANSWER_MS = 3000;
/** A second press so soon begins again. */
const SURE_MS = 5000;

/** @param {HTMLElement} root @param {import('../core/store.js').Store} store */
export function mount(root, store) {
  const view = new DepartureView(root, store);
  return () => view.stop();
}

class DepartureView {
  /** @type {Departure | null} */
  #departure = null;
  /** @type {Map<string, Row>} */
  #rows = new Map();
  #isStopped = false;
  #isBusy = false;
  #cells = '';
  #places = '';
  #meant = new Meant();
  #isLocked = false;
  #sure_ms = -Infinity;
  /** Why the newest answer is none; '': it is one. */
  #problem = '';
  #timer = 0;
  #due = new DueItems(() => this.#draw());

  /** @param {HTMLElement} root @param {import('../core/store.js').Store} store */
  constructor(root, store) {
    this.store = store;
    this.count = html('span', { class: 'end dep-count' });
    need(document, '#monitor .titlebar h2').after(this.count);
    this.cells = html('div', { class: 'dep-cells', role: 'img' });
    this.seal = html('section', { class: 'dep-seal', 'aria-label': 'Signature', hidden: true });
    this.list = html('ul', { class: 'dep-list', 'aria-label': 'Items of the departure check' });
    this.#meant.element = this.list;
    this.state = html('p', { class: 'state', role: 'status' }, 'Loading from the server…');
    this.bad = html('p', { class: 'bad', role: 'alert' });
    this.keyTitle = html('b');
    this.keyText = html('span');
    this.key = html('button', { type: 'button', class: 'main sign', 'data-f': 'departure-sign' }, this.keyTitle, this.keyText);
    this.duty = html('button', { type: 'button', class: 'key wide', 'data-f': 'departure-duty' }, 'Sign on first');
    this.again = html('button', { type: 'button', class: 'key wide', 'data-f': 'departure-again' });
    this.reopen = html('button', { type: 'button', class: 'key wide', 'data-f': 'departure-reopen' }, 'Open again');
    this.foot = html('div', { class: 'dep-foot' }, this.duty, this.key);
    root.replaceChildren(html('div', { class: 'departure' }, this.cells, this.state, this.seal, this.list,
      html('div', { class: 'dep-more' }, this.reopen, this.again), this.bad, this.foot));
    this.root = root;
    this.stops = [
      listen(this.key, 'click', () => void this.#press()),
      listen(this.duty, 'click', () => void openDuty(store, (sentence) => setSentence(this.bad, sentence))),
      listen(this.again, 'click', () => void this.#again()),
      listen(this.reopen, 'click', () => void this.#order('reopen_departure', {})),
      store.on('duty', () => this.#draw()),
      store.on('draw', () => this.#draw()),
      store.on('switch', () => this.#clear()),
    ];
    void styled('departure');
    void this.#ask();
  }

  stop() {
    this.#isStopped = true;
    clearTimeout(this.#timer);
    this.#meant.stop();
    this.count.remove();
    for (const stop of this.stops) stop();
    this.root.replaceChildren();
  }

  /** Another car is shown: nothing is known of its check. */
  #clear() {
    this.#departure = null;
    this.#problem = '';
    this.#sure_ms = -Infinity;
    this.#rows.clear();
    this.#cells = '';
    this.cells.replaceChildren();
    this.list.replaceChildren();
    for (const part of [this.count, this.bad]) setText(part, '');
    for (const part of [this.seal, this.foot, this.reopen, this.again]) show(part, false);
    show(this.state, true);
    setText(this.state, 'Loading from the server…');
  }

  async #ask() {
    clearTimeout(this.#timer);
    const { vehicle } = this.store;
    /** @type {Departure | null} */
    let answer = null;
    let problem = '';
    try {
      answer = await request(`/api/departure${vehicle ? `?vehicle=${encodeURIComponent(vehicle)}` : ''}`, { signal: AbortSignal.timeout(ANSWER_MS) });
    } catch (error) {
      problem = sentenceOf(error);
    }
    if (this.#isStopped) return;
    if (vehicle === this.store.vehicle) { // else it is of the car before
      this.#problem = problem;
      this.#departure = answer ?? this.#departure;
      this.#draw();
    }
    clearTimeout(this.#timer);
    const isNow = this.#departure !== null && nextOf(this.#departure)?.group === 'active';
    this.#timer = window.setTimeout(() => void this.#ask(), document.hidden ? 2000 : isNow ? EVERY_NOW_MS : EVERY_MS);
  }

  /** Why what stands here is old; '': it is not. */
  get #old() {
    return this.#problem || (this.store.isSilent ? 'The server does not answer.' : '');
  }

  #draw() {
    const departure = this.#departure;
    const old = this.#old;
    if (old || departure) setSentence(this.state, old && departure ? `${old} What is shown here is old.` : old);
    show(this.state, Boolean(this.state.textContent));
    if (!departure) return;
    setSentence(this.count, doneOf(departure));
    this.#due.want(this.store.vehicle, departure.items);
    const next = nextOf(departure);
    this.#drawCells(departure, next);
    this.#drawSeal(departure);
    this.#drawRows(departure, next);
    this.#drawFoot(departure);
  }

  /** @param {Departure} departure @param {Item | null} next */
  #drawCells(departure, next) {
    const faces = departure.items.map(({ id, result }) => (id === next?.id ? 'now' : result));
    const key = faces.join();
    if (key === this.#cells) return;
    this.#cells = key;
    setAttribute(this.cells, 'aria-label', `${doneOf(departure)} done${departure.failed ? `, ${departure.failed} failed` : ''}`);
    this.cells.replaceChildren(...faces.map((face) => html('i', { 'data-face': face })));
  }

  /** @param {Departure} departure */
  #drawSeal(departure) {
    const { signature } = departure;
    show(this.seal, signature !== null);
    if (!signature || this.seal.dataset['hash'] === signature.hash) return;
    setAttribute(this.seal, 'data-hash', signature.hash);
    const line = html('p', { class: 'm' });
    const date = new Date(signature.at_ms).toLocaleDateString('en-GB', { day: 'numeric', month: 'short', year: 'numeric' });
    setSentence(line, `${date}, ${timeOfDay(signature.at_ms)} · ${countWords(departure)}`);
    this.seal.replaceChildren(icon('ok'), html('b', {}, `Ready: signed by ${signature.by}${signature.role ? `, ${signature.role}` : ''}`), line,
      html('p', { class: 'm', title: signature.hash }, 'hash ', html('b', { class: 'n' }, shortHash(signature.hash)), ', valid until the end of this drive'));
  }

  /** Each item keeps its row as long as its face is the same: a finger may be on it. @param {Departure} departure @param {Item | null} next */
  #drawRows(departure, next) {
    const isLocked = departure.state !== 'open' || this.store.isViewer;
    const rows = rowsOf(departure);
    this.#noteMoves(rows.map(([{ id }, face]) => `${id} ${face}`).join());
    const ids = new Set(rows.map(([{ id }]) => id));
    for (const [id, row] of this.#rows) {
      if (ids.has(id) && isLocked === this.#isLocked) continue;
      row.parts.element.remove();
      this.#rows.delete(id);
    }
    this.#isLocked = isLocked;
    rows.forEach(([item, face], i) => {
      const had = this.#rows.get(item.id);
      const isSame = had !== undefined && had.face === face && had.item.title === item.title && had.item.need === item.need && had.item.kind === item.kind;
      const row = isSame ? had : new Row(item, face, this, isLocked);
      const hadFocus = !isSame && had?.parts.element.contains(document.activeElement);
      if (!isSame) {
        had?.parts.element.remove();
        this.#rows.set(item.id, row);
      }
      row.draw(this.#old ? { ...item, now: null, peak: null } : item, item.id === next?.id, this.#due.words(item));
      if (this.list.children[i] !== row.parts.element) this.list.insertBefore(row.parts.element, this.list.children[i] ?? null);
      if (hadFocus) row.parts.element.querySelector('button')?.focus({ preventScroll: true });
    });
  }

  /** Rows of another order, or of another height, moved under the finger. @param {string} rows */
  #noteMoves(rows) {
    if (rows === this.#places) return;
    this.#places = rows;
    this.#meant.moved();
  }

  /** @param {Departure} departure */
  #drawFoot(departure) {
    const { store } = this;
    const { state } = departure;
    const left = leftWords(departure);
    const isReady = state === 'none' || (state === 'open' && !left);
    const who = store.duty?.signs ?? store.name;
    show(this.foot, state !== 'signed' && !store.isViewer);
    setText(this.keyTitle, state === 'none' ? 'Begin the check' : left ? 'Sign' : `Sign as ${store.duty?.me?.name ?? who}`);
    setSentence(this.keyText, state === 'none' ? `${departure.of} items` : left || countWords(departure));
    setAttribute(this.key, 'aria-disabled', isReady && !this.#old ? null : 'true');
    show(this.duty, state === 'open' && !left && !store.isViewer && store.duty !== null && !store.duty.me && store.duty.people > 0);
    show(this.reopen, state === 'signed' && !store.isViewer);
    show(this.again, state !== 'none' && !store.isViewer);
    setText(this.again, performance.now() - this.#sure_ms < SURE_MS ? 'Press again: every result is lost' : 'Begin again');
    if (departure.complaint && !this.bad.textContent) setSentence(this.bad, departure.complaint);
  }

  async #press() {
    const departure = this.#departure;
    if (!departure || this.key.getAttribute('aria-disabled') === 'true') return;
    await (departure.state === 'none' ? this.#order('begin_departure', {}) : this.#order('sign_departure', { check: departure.check ?? '' }));
  }

  async #again() {
    const isSure = performance.now() - this.#sure_ms < SURE_MS;
    this.#sure_ms = isSure ? -Infinity : performance.now();
    if (isSure) await this.#order('begin_departure', {});
    else this.#draw();
  }

  // -- requests of a row -------------------------------------------------------------------------------------------

  /** @param {Item} item @param {Event} event */
  tick(item, event) {
    if (this.#meant.by(event)) void this.#order('set_departure_item', { item: item.id, result: item.result === 'done' ? 'open' : 'done' });
  }

  /** @param {Item} item */
  explain(item) {
    const { vehicle } = this.store;
    openWhy(item, async (result, note) => (vehicle === this.store.vehicle ? this.#order('set_departure_item', { item: item.id, result, note }) : 'Another car is shown now.'));
  }

  /** @param {Item} item @param {import('./departure-layout.js').Fix['does']} does @param {Event} event */
  fix(item, does, event) {
    if (!this.#meant.by(event)) return undefined;
    switch (does) {
      case 'record': return void this.#order('record', { on: true });
      case 'sound': return field(document, 'sound-off').click(); // as its banner does, within the press
      case 'check': return openScreen('check', item.of);
      case 'files': return void setSentence(this.bad, 'Go back, and open the tab Files.');
      default: return openScreen('signals');
    }
  }

  /** @param {any} kind @param {any} fields @returns {Promise<string | null>} why it was refused; null: it was not */
  async #order(kind, fields) {
    if (this.#isBusy) return 'Wait a moment.';
    this.#isBusy = true;
    setText(this.bad, '');
    const { vehicle } = this.store;
    const answer = await this.store.ask(kind, { ...(kind === 'record' ? {} : { vehicle }), ...fields });
    this.#isBusy = false;
    if (this.#isStopped || vehicle !== this.store.vehicle) return null;
    const why = answer.ok ? null : answer.reason ?? 'Refused.';
    if (why) setSentence(this.bad, why);
    await this.#ask();
    return why;
  }
}
