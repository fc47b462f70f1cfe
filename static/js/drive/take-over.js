// An intervention is described: what the data say of it stands there already, one tap is enough. An alarm closes the form;
// what was chosen and typed is kept until it is sent or the page is closed.

import { html, icon, listen, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { timeOfDay } from '../core/format.js';
import { speedWords } from '../core/units.js';
import { request, sentenceOf } from '../control/request.js';
import { addSheet, closeSheet, mustWait, openSheet } from '../shell/sheet.js';
import { AFTER_S, TakeOverPlot } from './take-over-plot.js';
import { CATEGORIES, KINDS, STARTERS, alarmWords, startedWords } from './mode-text.js';
import { styled } from '../core/style-sheet.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('./mode-text.js').Intervention} Intervention
 * @typedef {{category: string | null, what: string, by: Intervention['initiated_by'] | null}} Draft
 */

const MOST_LETTERS = 2000;
const AGAIN_MS = 1000;
/** An answer that takes longer is none. */
const ANSWER_MS = 5000;

/** What was chosen and not sent yet, by intervention. @type {Map<string, Draft>} */
const drafts = new Map();

/** @param {string} id @param {Store} store @param {import('./mode-key.js').Say} say */
export async function openTakeOver(id, store, say) {
  await styled('drive');
  if (mustWait() || document.querySelector('#sheet-take-over')) return;
  new TakeOver(id, store, say);
}

class TakeOver {
  #plot = new TakeOverPlot();
  /** @type {Intervention | null} */
  #found = null;
  #isSent = false;
  #isAsking = false;
  #asked_ms = -Infinity;

  /** @param {string} id @param {Store} store @param {import('./mode-key.js').Say} say */
  constructor(id, store, say) {
    this.id = id;
    this.store = store;
    this.say = say;
    this.vehicle = store.vehicle;
    this.draft = drafts.get(id) ?? { category: null, what: '', by: null };
    const known = store.frame?.mode?.open.find((one) => one.id === id); // before it is loaded
    this.title = html('h2', { id: 'take-over-title', tabindex: '-1' }, KINDS[known?.kind_of ?? '']?.title ?? 'Intervention');
    this.count = html('span', { class: 'sub' });
    this.facts = ['at', 'by', 'alarms'].map((name) => {
      const parts = { label: html('span', { class: 'sub' }), value: html('span', { class: 'n' }), unit: html('span', { class: 'u' }), text: html('span', { class: 'm' }) };
      return { ...parts, element: html('div', { 'data-f': `fact-${name}` }, parts.label, html('p', {}, parts.value, parts.unit), parts.text) };
    });
    this.chips = CATEGORIES.map(([category, words]) => html('button', { type: 'button', class: 'key chip-key', 'data-category': category }, words));
    this.starters = STARTERS.map(([by, words]) => html('button', { type: 'button', 'data-by': by }, words));
    this.words = /** @type {HTMLTextAreaElement} */ (html('textarea', { rows: 1, maxlength: MOST_LETTERS, dir: 'auto', 'aria-label': 'What happened, in words', placeholder: 'words, if you wish', 'data-f': 'what' }));
    this.words.value = this.draft.what;
    this.unread = html('p', { class: 'bad', role: 'status' }); // why it could not be loaded
    this.bad = html('p', { class: 'bad', role: 'alert' }); // why it was refused
    this.keep = html('button', { type: 'button', class: 'key wide solid', 'data-f': 'keep' }, 'Keep');
    this.later = html('button', { type: 'button', class: 'key wide', 'data-f': 'later' }, 'Later');
    this.sheet = this.#build();
    this.stops = [addSheet(this.sheet), ...this.#listeners()];
    this.sheet.addEventListener('close', () => this.#closed(), { once: true });
    this.draw();
    openSheet(this.sheet);
    this.title.focus({ preventScroll: true });
    void this.#ask();
  }

  #build() {
    const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close', 'data-f': 'no' }, icon('close'));
    return /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet mark-sheet take-over', id: 'sheet-take-over', 'aria-labelledby': 'take-over-title' },
      html('div', { class: 'mark-head' }, this.title, this.count, close),
      html('div', { class: 'mark-body', tabindex: '0', role: 'group', 'aria-label': 'The intervention' }, this.unread,
        html('div', { class: 'take-facts' }, ...this.facts.map(({ element }) => element)),
        html('p', { class: 'lab2' }, html('span', {}, 'What was the reason?'), html('span', {}, 'one tap is enough')),
        html('div', { class: 'chip-rows', role: 'group', 'aria-label': 'Category' }, ...this.chips), this.words,
        html('p', { class: 'lab2' }, html('span', {}, 'Started by'), html('span', {}, 'from the data; press to correct')),
        html('div', { class: 'seg', role: 'group', 'aria-label': 'Started by' }, ...this.starters), this.#plot.element), // the keys first: on a low phone the plot is what scrolls
      this.bad, // not in the body, which scrolls
      html('div', { class: 'mark-keys' }, this.later, this.keep)));
  }

  #listeners() {
    const { sheet, store } = this;
    return [
      store.on('draw', () => this.#look()),
      store.on('switch', () => closeSheet(sheet)),
      listen(sheet, 'click', (event) => this.#pressed(event)),
      listen(this.words, 'input', () => {
        this.draft.what = this.words.value;
        this.draw();
      }),
      listen(this.later, 'click', () => closeSheet(sheet)),
      listen(this.keep, 'click', () => void this.#send()),
    ];
  }

  /** @param {MouseEvent} event */
  #pressed(event) {
    const key = /** @type {HTMLElement | null} */ (event.target instanceof Element ? event.target.closest('[data-category], [data-by]') : null);
    if (!key) return;
    const { category, by } = key.dataset;
    if (category) this.draft.category = this.draft.category === category ? null : category;
    else if (by) this.draft.by = /** @type {Intervention['initiated_by']} */ (by);
    this.draw();
  }

  /** Samples after the intervention come for 6 s; what could not be loaded is requested again. */
  #look() {
    const last = this.#found?.samples.at(-1)?.at_s ?? -Infinity;
    const ago_s = ((this.store.frame?.server.time_ms ?? 0) - (this.#found?.at_ms ?? 0)) / 1000;
    const isWhole = this.#found !== null && (last >= AFTER_S - 0.5 || ago_s >= AFTER_S + 3);
    if (!isWhole && !this.#isAsking && this.store.now() - this.#asked_ms > AGAIN_MS) void this.#ask();
    if (mustWait()) closeSheet(this.sheet);
  }

  async #ask() {
    this.#asked_ms = this.store.now();
    this.#isAsking = true;
    try {
      this.#found = await request(`/api/interventions/${encodeURIComponent(this.id)}?${new URLSearchParams({ vehicle: this.vehicle })}`, { signal: AbortSignal.timeout(ANSWER_MS) });
      setSentence(this.unread, '');
    } catch (error) {
      setSentence(this.unread, sentenceOf(error));
    }
    this.#isAsking = false;
    this.draw();
  }

  async #send() {
    const { category, what, by } = this.draft;
    if (this.#isSent || (category === null && !what.trim())) return;
    this.#isSent = true;
    setSentence(this.bad, '');
    this.draw();
    const fields = { vehicle: this.vehicle, intervention: this.id, what: what.trim(), category, initiated_by: by };
    const answer = await this.store.ask('describe_intervention', fields);
    this.#isSent = false;
    if (!answer.ok) {
      if (this.sheet.open) {
        setSentence(this.bad, answer.reason ?? 'Refused.');
        this.draw();
      } else this.say(answer.reason ?? 'Refused.', 'Not described');
      return;
    }
    drafts.delete(this.id);
    this.draft = { category: null, what: '', by: null };
    closeSheet(this.sheet);
    this.say('The intervention is described.');
  }

  #closed() {
    const { category, what, by } = this.draft;
    if (category !== null || what.trim() || by !== null) drafts.set(this.id, this.draft);
    else drafts.delete(this.id);
    this.stops.forEach((stop) => stop());
  }

  draw() {
    const found = this.#found;
    const { category, what, by } = this.draft;
    for (const chip of this.chips) setAttribute(chip, 'aria-pressed', String(chip.dataset['category'] === category));
    const starter = by ?? found?.initiated_by;
    for (const key of this.starters) setAttribute(key, 'aria-pressed', String(key.dataset['by'] === starter));
    setAttribute(this.keep, 'aria-disabled', category === null && !what.trim() ? 'true' : null);
    for (const line of [this.unread, this.bad]) show(line, line.textContent !== '');
    if (!found) return;
    setText(this.title, KINDS[found.kind_of]?.title ?? 'Intervention');
    setText(this.count, `${found.left} to describe`);
    const [speed, unit] = speedWords(Math.abs(found.speed_mps));
    const started = startedWords(found);
    const alarms = alarmWords(found);
    const rows = [
      { title: 'At', value: speed, unit, text: timeOfDay(found.at_ms) },
      started,
      { title: 'Alarms', value: alarms.value, unit: '', text: alarms.text },
    ];
    this.facts.forEach((fact, i) => {
      const row = rows[i];
      if (!row) return;
      setText(fact.label, row.title);
      setText(fact.value, row.value);
      setText(fact.unit, row.unit);
      setSentence(fact.text, row.text);
    });
    this.#plot.draw(found.samples, found.kind_of === 'to_manual');
  }
}
