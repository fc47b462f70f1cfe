// What stands behind one signal: its source and why, what else there is, its frame and unit, and the keys that change them.

import { html, setAttribute, textNodes } from '../core/dom.js';
import { openTopicPicker } from '../settings/topic-picker.js';
import { settingsOf } from '../settings/settings-model.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('../settings/settings-model.js').Candidate} Candidate
 */

/** What else there is, is fetched so often while a signal is open [ms]. */
const FETCH_EVERY_MS = 3000;
/** So many other topics are listed; the list of all is behind the key. */
const MOST_LISTED = 6;

/** The topics of the car that could carry a signal, as they were a moment ago. */
export class CandidateFeed {
  /** null: the car does not say, or not yet. @type {Record<string, Candidate[]> | null} */
  #found = null;
  #asked_ms = -Infinity;

  /** @param {Store} store */
  constructor(store) {
    this.store = store;
    this.model = settingsOf(store);
  }

  /** Those of a signal, in a replay of its recording; null: not known. @param {string} name */
  of(name) {
    const { model, store } = this;
    if (!store.isSilent && store.now() - this.#asked_ms > FETCH_EVERY_MS) {
      this.#asked_ms = store.now();
      model.candidates().then(({ candidates }) => { this.#found = candidates; }, () => { this.#found = null; });
    }
    return this.#found?.[name] ?? null;
  }
}

/**
 * What else could carry a signal, a line each.
 * @param {Candidate[] | null} candidates null: not known
 * @param {string | null} now the topic that carries it
 * @returns {{topic: string, detail: string}[]}
 */
export function otherWords(candidates, now) {
  const others = (candidates ?? []).filter(({ topic }) => topic !== now);
  const rows = others.slice(0, MOST_LISTED).map(({ topic, type, frame, why }) => ({ topic, detail: [type, frame ? `frame ${frame}` : '', why ?? ''].filter(Boolean).join('\n') }));
  return others.length > MOST_LISTED ? [...rows, { topic: `and ${others.length - MOST_LISTED} more`, detail: '' }] : rows;
}

export class SignalMore {
  #shown = '';

  /** @param {Store} store @param {string} name @param {(sentence: string, title?: string) => void} say @param {CandidateFeed} feed */
  constructor(store, name, say, feed) {
    this.store = store;
    this.name = name;
    this.say = say;
    this.feed = feed;
    this.element = html('dl', { class: 'sig-more', hidden: true });
    this.choice = html('button', { type: 'button', class: 'key wide', 'data-operator': '' }, 'Choose another topic');
    this.choice.addEventListener('click', () => void openTopicPicker(store, feed.model, name));
    this.units = html('div', { class: 'unit-keys', role: 'group', 'aria-label': 'Unit that the car publishes' });
  }

  get isOpen() {
    return !this.element.hasAttribute('hidden');
  }

  /** @param {[string, string][]} details of the signal */
  draw(details) {
    const { model } = this.feed;
    model.look();
    const others = otherWords(this.feed.of(this.name), this.store.signal(this.name)?.topic ?? null);
    const choices = model.body?.unit_choices?.[this.name] ?? [];
    const key = JSON.stringify([details, others, choices]);
    if (key !== this.#shown) this.#fill(details, others, choices);
    this.#shown = key;
    const chosen = model.chosen.units[this.name] ?? '';
    for (const one of this.units.children) setAttribute(one, 'aria-pressed', String(/** @type {HTMLElement} */ (one).dataset['unit'] === chosen));
  }

  /** @param {[string, string][]} details @param {{topic: string, detail: string}[]} others @param {{name: string, label: string}[]} choices */
  #fill(details, others, choices) {
    this.units.replaceChildren(...[{ name: '', label: 'as found' }, ...choices].map(({ name, label }) => this.#unitKey(name, label)));
    const rows = details.map(([term, text]) => /** @type {[string, HTMLElement]} */ ([term, html('dd', {}, ...textNodes(text))]));
    if (choices.length) rows.push(['Published in', html('dd', {}, this.units)]);
    rows.push(['Choice', html('dd', {}, this.choice)]);
    if (others.length) rows.push(['Others', html('dd', { class: 'others' }, ...others.map(({ topic, detail }) => html('p', {}, html('b', {}, topic), ...(detail ? ['\n', ...textNodes(detail)] : []))))]);
    this.element.replaceChildren(...rows.flatMap(([term, description]) => [html('dt', {}, term), description]));
  }

  /** @param {string} unit '': as found @param {string} label */
  #unitKey(unit, label) {
    const key = html('button', { type: 'button', class: 'key', 'data-unit': unit, 'data-operator': '' }, html('span', {}, ...textNodes(label)));
    key.addEventListener('click', async () => {
      const outcome = await this.feed.model.set({ units: { [this.name]: unit || null } });
      if (!outcome.ok) this.say(outcome.reason ?? 'Refused.', 'Unit not changed');
    });
    return key;
  }
}
