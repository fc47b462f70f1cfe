// The marks of this drive: those that wait on this phone first, then what the server has, of every phone and of the car.

import { PlayKey } from './play-key.js';
import { countWords, headWords, markedAt, moreWords, stepOf, waitingWords } from './mark-model.js';
import { request } from '../control/request.js';
import { html, icon, listen, setText, setSentence, show, textNodes } from '../core/dom.js';
import { timeOfDay } from '../core/format.js';
import { addSheet, mustWait, openSheet } from '../shell/sheet.js';
import { shape } from './drive-parts.js';
import { partOf } from './mark-server.js';
import { quietly } from './marks.js';

/** @typedef {{mark: string, marked_ms: number, category: string | null, words: string, voice: boolean, photo: boolean, source: string, by: string | null, at_s?: number, late?: boolean}} Stored as the server has it */
/** @typedef {{id: string, at_ms: number, head: string, more: string[], isWaiting: boolean, isOwn: boolean, isRefused: boolean, voice: boolean}} Row */

/** The texts of a mark of the server. @param {Stored} mark */
export function storedWords({ marked_ms, category, words, voice, photo, source, by }) {
  const kind = category || (voice ? 'voice' : photo ? 'photo' : words ? 'words' : 'tap only');
  return { head: `${timeOfDay(marked_ms)} · ${kind}`, more: [...(words ? [words] : []), ...(voice && kind !== 'voice' ? ['voice'] : []), ...(photo && kind !== 'photo' ? ['photo'] : []), source === 'car' ? 'by the car’s button' : by ?? ''].filter(Boolean) };
}

/**
 * The rows, newest first; what this phone has wins, for it is newer.
 * @param {import('./mark-model.js').Mark[]} own
 * @param {Stored[]} stored
 * @returns {Row[]}
 */
export function rowsOf(own, stored) {
  const rows = own.map((mark) => ({ id: mark.id, at_ms: markedAt(mark), head: headWords(mark), more: moreWords(mark), isWaiting: stepOf(mark) !== null, isOwn: true, isRefused: mark.refused !== '', voice: mark.voice !== null }));
  const others = stored.filter(({ mark }) => !own.some(({ id }) => id === mark)).map((mark) => ({ id: mark.mark, at_ms: mark.marked_ms, ...storedWords(mark), isWaiting: false, isOwn: false, isRefused: false, voice: mark.voice }));
  return [...rows, ...others].sort((a, b) => Number(b.isWaiting) - Number(a.isWaiting) || b.at_ms - a.at_ms);
}

/**
 * @param {import('./marks.js').Marks} marks
 * @param {import('./marks.js').Say} say
 * @param {(id: string) => void} openOne
 */
export function openMarkList(marks, say, openOne) {
  if (!mustWait()) new MarkList(marks, say, openOne);
}

class MarkList {
  /** @type {Stored[]} */
  #stored = [];
  #drawn = '';
  #problem = '';
  /** @type {PlayKey[]} */
  #players = [];

  /** @param {import('./marks.js').Marks} marks @param {import('./marks.js').Say} say @param {(id: string) => void} openOne */
  constructor(marks, say, openOne) {
    this.marks = marks;
    this.say = say;
    this.openOne = openOne;
    this.count = html('span', { class: 'sub' });
    this.waiting = html('div', { class: 'marks-wait', hidden: true }, icon('phone'), html('b'), html('p'));
    this.rows = html('ul', { class: 'mark-rows', 'aria-label': 'Marks' });
    this.none = html('p', { class: 'sub marks-none', hidden: true }, 'No marks in this drive yet. Press “Mark” to mark a moment.');
    const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close', 'data-f': 'no' }, icon('close'));
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed mark-list', id: 'sheet-marks', 'aria-labelledby': 'marks-title' },
      html('div', { class: 'mark-head' }, html('h2', { id: 'marks-title' }, 'Marks'), this.count, close),
      html('div', { class: 'mark-body', tabindex: '0', role: 'group', 'aria-label': 'Marks of this drive' }, this.waiting, this.none, this.rows)));
    const stops = [addSheet(this.sheet), marks.onChange(() => quietly(() => this.draw())), marks.store.on('draw', () => quietly(() => this.draw())),
      listen(this.rows, 'click', (event) => this.#pressed(event))];
    this.sheet.addEventListener('close', () => [...stops, ...this.#players.map((player) => () => player.stop())].forEach((stop) => stop()), { once: true });
    this.draw();
    openSheet(this.sheet);
    void this.#ask();
  }

  async #ask() {
    try {
      const { marks } = await request(`/api/marks?${new URLSearchParams({ vehicle: this.marks.store.vehicle })}`);
      this.#stored = Array.isArray(marks) ? marks : [];
      this.#problem = '';
    } catch {
      this.#problem = 'Marks of other phones are not shown: the server does not answer.';
    }
    this.draw();
  }

  /** @param {MouseEvent} event */
  #pressed(event) {
    const key = /** @type {HTMLElement | null} */ (event.target instanceof Element ? event.target.closest('[data-mark]') : null);
    if (key?.dataset['mark']) this.openOne(key.dataset['mark']);
  }

  draw() {
    const { marks } = this;
    const rows = rowsOf(marks.all, this.#stored);
    const key = JSON.stringify([rows, this.#problem, marks.isServerThere, marks.isDurable]);
    if (key === this.#drawn) return;
    this.#drawn = key;
    const { waiting } = marks;
    setSentence(this.count, countWords(waiting.length, rows.length - waiting.length));
    show(this.waiting, waiting.length > 0);
    const notice = waitingWords(waiting, marks.isDurable, !marks.isServerThere);
    setSentence(/** @type {Element} */ (this.waiting.querySelector('b')), notice.title);
    setSentence(/** @type {Element} */ (this.waiting.querySelector('p')), notice.text);
    show(this.none, rows.length === 0 || this.#problem !== '');
    setText(this.none, this.#problem || 'No marks in this drive yet. Press “Mark” to mark a moment.');
    for (const player of this.#players) player.stop();
    this.#players = [];
    this.rows.replaceChildren(...rows.map((row) => this.#row(row)));
  }

  /** @param {Row} row */
  #row({ id, head, more, isWaiting, isOwn, isRefused, voice }) {
    const text = [html('b', { class: 't' }, ...textNodes(head)), html('bdi', { class: 'm' }, ...textNodes(more.join(' · ')))];
    const what = isOwn ? html('button', { type: 'button', class: 'row', 'data-mark': id }, shape('flag'), ...text) : html('div', { class: 'row' }, shape('flag'), ...text);
    const state = html('span', { class: 'state', 'data-state': isWaiting ? 'waits' : 'stored' }, icon(isWaiting ? 'phone' : 'ok', 's'), isWaiting ? (isRefused ? 'Refused' : 'Waits on this device') : 'Stored');
    const item = html('li', {}, what, state);
    if (voice && !isOwn) {
      const player = new PlayKey(() => partOf(id, 'voice', this.marks.store.vehicle), this.say);
      player.draw(null);
      this.#players.push(player);
      item.append(player.element);
    }
    return item;
  }
}
