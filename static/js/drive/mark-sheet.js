// A mark looked at closely: moved, put into a category, described, with its voice and its photo. It covers the ledge and never
// the rail; an alarm closes it, and what was typed is kept.

import { MarkPlot, courseOf } from './mark-plot.js';
import { PlayKey } from './play-key.js';
import { PhotoView } from './photo-view.js';
import { CATEGORIES, MOST_SHIFT_S, MOST_WORDS, categoryWords, markedAt, refusedWords } from './mark-model.js';
import { html, icon, listen, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { signed, timeOfDay } from '../core/format.js';
import { SPECS } from '../home/trends-layout.js';
import { trendsOf } from '../home/trend-feed.js';
import { pickPhoto } from './photo-input.js';
import { partOf } from './mark-server.js';
import { quietly } from './marks.js';
import { addSheet, closeSheet, mustWait, openSheet } from '../shell/sheet.js';
import { shape } from './drive-parts.js';

const STEPS_S = /** @type {const} */ ([-1, -0.1, 0.1, 1]);
/** What was typed is kept after so long without another key [ms]. */
const TYPED_MS = 400;

/**
 * @param {string} id
 * @param {import('./marks.js').Marks} marks
 * @param {import('./marks.js').Say} say
 * @param {() => void} openList
 */
export function openMarkSheet(id, marks, say, openList) {
  if (mustWait() || !marks.get(id)) return;
  new MarkSheet(id, marks, say, openList);
}

class MarkSheet {
  #plot = new MarkPlot();
  #play;
  #photo;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #typing;

  /** @param {string} id @param {import('./marks.js').Marks} marks @param {import('./marks.js').Say} say @param {() => void} openList */
  constructor(id, marks, say, openList) {
    this.id = id;
    this.marks = marks;
    this.say = say;
    this.openList = openList;
    const { vehicle } = marks.store;
    this.#play = new PlayKey(() => this.#source('voice', vehicle), say);
    this.#photo = new PhotoView(() => this.#source('photo', vehicle));
    this.title = html('h2', { id: 'mark-title', tabindex: '-1' });
    this.when = html('span', { class: 'sub' });
    this.shift = html('b', { class: 'n' });
    this.from = html('span', {}, 'from the tap');
    this.chips = CATEGORIES.map((category) => html('button', { type: 'button', class: 'key chip-key', 'data-category': category, 'data-operator': '' }, categoryWords(category)));
    this.words = /** @type {HTMLTextAreaElement} */ (html('textarea', { rows: 1, maxlength: MOST_WORDS, dir: 'auto', 'aria-label': 'Words', placeholder: 'What happened?', enterkeyhint: 'done', 'data-f': 'mark-text', 'data-operator': '' }));
    this.words.value = marks.get(id)?.words ?? '';
    this.note = html('p', { class: 'sub note' });
    this.photoKey = html('button', { type: 'button', class: 'key wide', 'data-f': 'sheet-photo', 'data-operator': '' }, shape('camera'), 'Photo');
    this.sheet = this.#build();
    const stop = addSheet(this.sheet);
    this.stops = [stop, ...this.#listeners()];
    this.sheet.addEventListener('close', () => this.#closed(), { once: true });
    this.draw();
    openSheet(this.sheet);
    this.title.focus({ preventScroll: true });
  }

  #build() {
    const steps = STEPS_S.map((step_s) => html('button', { type: 'button', class: 'key step', 'data-step': step_s, 'data-operator': '', 'aria-label': `${signed(step_s)} s` }, Math.abs(step_s) === 1 ? `${signed(step_s, 0)} s` : signed(step_s)));
    const list = html('button', { type: 'button', class: 'btn', 'aria-label': 'All marks of this drive', 'data-f': 'mark-list' }, icon('files'));
    const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close', 'data-f': 'no' }, icon('close'));
    const remove = html('button', { type: 'button', class: 'key wide', 'data-f': 'mark-withdraw', 'data-operator': '' }, icon('trash'), 'Withdraw');
    const keep = html('button', { type: 'button', class: 'key wide solid', 'data-f': 'mark-keep', 'data-operator': '' }, 'Keep');
    return /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet mark-sheet', id: 'sheet-mark', 'aria-labelledby': 'mark-title' },
      html('div', { class: 'mark-head' }, this.title, this.when, list, close),
      html('div', { class: 'mark-body', tabindex: '0', role: 'group', 'aria-label': 'The mark' },
        this.#plot.element,
        html('div', { class: 'step-row' }, ...steps.slice(0, 2), html('p', { class: 'shift', role: 'status' }, html('span', {}, this.shift, ' s'), this.from), ...steps.slice(2)),
        html('div', { class: 'chip-rows', role: 'group', 'aria-label': 'Category' }, ...this.chips),
        this.words, html('div', { class: 'part-row' }, this.#play.element, this.#photo.element, this.photoKey), this.note),
      html('div', { class: 'mark-keys' }, remove, keep)));
  }

  #listeners() {
    const { marks, sheet } = this;
    const press = (/** @type {string} */ name, /** @type {() => void} */ act) => listen(/** @type {HTMLElement} */ (sheet.querySelector(`[data-f="${name}"]`)), 'click', act);
    return [
      marks.onChange(() => quietly(() => this.draw())),
      marks.store.on('draw', () => quietly(() => this.draw())),
      listen(sheet, 'click', (event) => this.#pressed(event)),
      listen(this.words, 'input', () => {
        clearTimeout(this.#typing);
        this.#typing = setTimeout(() => this.#keepWords(), TYPED_MS);
      }),
      listen(this.photoKey, 'click', () => pickPhoto(this.id, marks, this.say)),
      press('mark-keep', () => closeSheet(sheet)),
      press('mark-withdraw', () => {
        void marks.remove(this.id);
        closeSheet(sheet);
      }),
      press('mark-list', () => this.openList()),
    ];
  }

  /** @param {MouseEvent} event */
  #pressed(event) {
    const key = /** @type {HTMLElement | null} */ (event.target instanceof Element ? event.target.closest('[data-step], [data-category]') : null);
    const mark = this.marks.get(this.id);
    if (!key || !mark) return;
    const { category, step } = key.dataset;
    if (category) void this.marks.edit(this.id, { category: mark.category === category ? null : category });
    else if (step) this.#move(mark, Number(step));
  }

  /** @param {import('./mark-model.js').Mark} mark @param {number} step_s */
  #move(mark, step_s) {
    const latest_s = Math.max(0, (this.marks.now_ms - mark.tap_ms) / 1000); // not into what is to come
    const shift_s = Math.round(10 * Math.min(Math.max(mark.shift_s + step_s, -MOST_SHIFT_S), MOST_SHIFT_S, latest_s)) / 10;
    void this.marks.edit(this.id, { shift_s });
  }

  #keepWords() {
    clearTimeout(this.#typing);
    if (this.marks.store.isViewer) return; // who can only watch may have typed all the same
    void this.marks.edit(this.id, { words: this.words.value.trim() });
  }

  #closed() {
    this.#keepWords();
    this.#play.stop();
    this.#photo.stop();
    for (const stop of this.stops) stop();
  }

  /** Where its voice or photo is now; null: there is none. @param {'voice' | 'photo'} name @param {string} vehicle */
  #source(name, vehicle) {
    const part = this.marks.get(this.id)?.[name];
    if (!part || part.isOpen) return null;
    if (part.blob) return part.blob;
    return part.isStored ? partOf(this.id, name, vehicle) : null;
  }

  draw() {
    const mark = this.marks.get(this.id);
    if (!mark || mark.isRemoved) return closeSheet(this.sheet);
    const at_ms = markedAt(mark);
    setSentence(this.title, `Mark at ${timeOfDay(at_ms)}`);
    setSentence(this.when, `.${Math.floor((((at_ms % 1000) + 1000) % 1000) / 100)}`);
    setText(this.shift, mark.shift_s ? signed(mark.shift_s) : '0.0');
    for (const chip of this.chips) setAttribute(chip, 'aria-pressed', String(chip.dataset['category'] === mark.category));
    const { store } = this.marks;
    const speed = SPECS[0];
    this.#plot.draw(speed ? courseOf(trendsOf(store).course(speed), (this.marks.now_ms - mark.tap_ms) / 1000, store.limit('speed_limit.max_mps')) : null, mark.shift_s);
    this.#play.draw(mark.voice?.length_s ?? null);
    this.#photo.draw();
    const notes = [mark.voice?.note, mark.photo?.note, refusedWords(mark)].filter(Boolean).join('. ');
    setSentence(this.note, notes);
    show(this.note, notes !== '');
  }
}
