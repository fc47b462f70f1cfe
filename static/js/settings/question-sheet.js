// The sheet of a question: its text, its options as large keys, and for lasers what each of them sees now.

import { html, setText, setSentence, show } from '../core/dom.js';
import { Meant } from '../core/meant.js';
import { styled } from '../core/style-sheet.js';
import { addSheet, closeSheet, openSheet } from '../shell/sheet.js';
import { answerOf, keyOf, mayAnswer, meanwhileWords, placeOf, restWords } from './question-layout.js';
import { ScanSketch, reachOf, sketchedOf } from './scan-sketch.js';
import { settingsOf } from './settings-model.js';

/** The drawings are fetched again so long after the last answer [ms]. */
const AGAIN_MS = 1000;

const UNSENT = { ok: false, reason: 'It could not be loaded from the server. Try again.' };

/**
 * @typedef {{ok: boolean, reason?: string}} Outcome
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('./question-layout.js').Question} Question
 * @typedef {(sentence: string, title?: string) => void} Say
 */

/**
 * @typedef {object} Does what the sheet has done elsewhere
 * @property {Say} say
 * @property {(() => void) | null} later the question is put off; null: it already is
 * @property {(() => void) | null} next opens the next question; null: there is none
 * @property {() => void} answered
 */

/** The open sheet. @type {QuestionSheet | null} */
let open = null;

/**
 * @param {Store} store
 * @param {Question} question
 * @param {Does} does
 */
export function openQuestion(store, question, does) {
  open?.close();
  open = new QuestionSheet(store, question, does);
}

class QuestionSheet {
  /** @type {Map<string, {sketch: ScanSketch, key: HTMLElement}>} */
  #options = new Map();
  #drawn = '';
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #timer;
  #isSent = false;

  /** @param {Store} store @param {Question} question @param {Does} does */
  constructor(store, question, does) {
    void styled('sources');
    this.store = store;
    this.question = question;
    this.does = does;
    this.model = settingsOf(store);
    this.which = keyOf(placeOf(store), question);
    this.label = store.signal(question.signal)?.label ?? question.signal;
    this.text = html('span');
    this.heading = html('h2', { id: 'question-title', tabindex: '-1' }, this.text);
    this.list = html('ul', { class: 'menu-list' });
    this.bad = html('p', { class: 'bad', role: 'alert' });
    this.rest = html('p', { class: 'sub' });
    const effect = html('p', { class: 'sub', id: 'question-words' });
    setSentence(effect, meanwhileWords(question, this.label));
    const close = html('button', { type: 'button', class: 'key', 'data-f': 'no' }, does.later ? 'Later' : 'Close');
    const next = html('button', { type: 'button', class: 'key', 'data-f': 'next' }, 'Next question');
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed pick-sheet question-sheet', id: 'sheet-question', 'aria-labelledby': 'question-title', 'aria-describedby': 'question-words' },
      html('div', { class: 'bd' }, this.heading, effect, this.bad), this.list,
      html('div', { class: 'keys' }, this.rest, does.next ? html('div', { class: 'pair' }, close, next) : close)));
    this.meant = new Meant(this.sheet);
    const stops = [addSheet(this.sheet), store.on('draw', () => this.#look())];
    close.addEventListener('click', () => does.later?.());
    next.addEventListener('click', () => does.next?.());
    this.sheet.addEventListener('close', () => {
      clearTimeout(this.#timer);
      stops.forEach((stop) => stop());
      if (open === this) open = null;
    }, { once: true });
    openSheet(this.sheet);
    this.#fill(question);
    this.heading.focus();
    this.model.look();
    if (question.kind === 'source' && question.signal === 'scan') void this.#follow();
  }

  close() {
    closeSheet(this.sheet);
  }

  /** It may be answered, or another page in control, while this sheet stands; and its options may be others. */
  #look() {
    const { store } = this;
    const now = store.frame?.questions?.find((one) => keyOf(placeOf(store), one) === this.which);
    if (!now || !mayAnswer(store)) this.close();
    else this.#fill(now);
  }

  /** @param {Question} question */
  #fill(question) {
    const key = JSON.stringify(question);
    if (key === this.#drawn) return;
    this.#drawn = key;
    this.question = question;
    setSentence(this.text, question.words);
    setSentence(this.rest, restWords(question));
    this.#options.clear();
    this.list.replaceChildren(...question.options.map((option) => html('li', {}, this.#key(option))));
    this.meant.moved();
  }

  /** @param {import('./question-layout.js').Option} option */
  #key({ value, label, why }) {
    const text = html('small', {});
    setSentence(text, why);
    const key = html('button', { type: 'button', 'data-value': value, 'data-operator': '' }, html('span', { class: 'tx' }, html('b', {}, label), text));
    this.#options.set(value, { sketch: new ScanSketch(), key });
    key.addEventListener('click', (event) => this.meant.by(event) && void this.#answer(value, label));
    return key;
  }

  /** @param {string} value @param {string} label */
  async #answer(value, label) {
    if (this.#isSent) return;
    this.#isSent = true;
    setText(this.bad, '');
    const { replaying } = this.store;
    const outcome = await this.#keep(value).catch(() => UNSENT);
    this.#isSent = false;
    if (outcome.ok) {
      this.does.answered();
      this.close();
      this.does.say(`${this.label}: ${label}.${replaying ? ' This replay is judged by it.' : ''}`, 'Chosen');
    } else setSentence(this.bad, `Not chosen. ${outcome.reason}`);
  }

  /** Into the settings of the car, or for this replay. @param {string} value @returns {Promise<Outcome>} */
  async #keep(value) {
    if (!this.model.body && !this.store.replaying) await this.model.load();
    return this.model.set(answerOf(this.question, value));
  }

  /** Draws what each laser sees, and again a moment later. */
  async #follow() {
    if (!this.sheet.open) return;
    if (!this.store.isSilent) await this.#draw().catch(() => {}); // the next attempt may succeed
    if (this.sheet.open) this.#timer = setTimeout(() => void this.#follow(), AGAIN_MS);
  }

  async #draw() {
    const { candidates } = await this.model.candidates();
    const scans = new Map((candidates?.[this.question.signal] ?? []).map((offer) => [offer.topic, sketchedOf(offer)]));
    const shown = [...this.#options.keys()].flatMap((topic) => scans.get(topic) ?? []);
    const reach_m = reachOf(shown);
    for (const [topic, { sketch, key }] of this.#options) {
      const scan = scans.get(topic);
      if (scan && !sketch.element.isConnected) key.prepend(sketch.element);
      show(sketch.element, Boolean(scan));
      if (scan) sketch.draw(scan, reach_m);
    }
  }
}
