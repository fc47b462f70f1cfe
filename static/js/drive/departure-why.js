// Why an item of the departure check is not applicable, or failed: one chip or a text. The entry can be taken back.

import { REASONS } from './departure-layout.js';
import { intervalWords } from './due.js';
import { html, icon, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { addSheet, closeSheet, mustWait, openSheet } from '../shell/sheet.js';

/** @typedef {import('./departure-layout.js').Item} Item @typedef {'not_applicable' | 'failed'} Verdict */

const TITLES = { not_applicable: 'Not applicable', failed: 'Failed' };

/**
 * @param {Item} item
 * @param {(result: Item['result'], note: string) => Promise<string | null>} set why it was refused; null: it was not
 */
export function openWhy(item, set) {
  if (!mustWait() && !document.querySelector('#sheet-departure[open]')) new WhySheet(item, set);
}

class WhySheet {
  /** @type {Verdict} */
  #verdict = 'not_applicable';
  #reason = '';

  /** @param {Item} item @param {(result: Item['result'], note: string) => Promise<string | null>} set */
  constructor(item, set) {
    this.item = item;
    this.set = set;
    this.title = html('h2', { id: 'departure-why', tabindex: '-1' });
    this.verdicts = html('div', { class: 'seg', role: 'group', 'aria-label': 'What holds' }, ...this.#verdictKeys());
    this.chips = html('div', { class: 'dep-chips', role: 'group', 'aria-label': 'Reason' });
    this.words = /** @type {HTMLInputElement} */ (html('input', { type: 'text', maxlength: 200, autocomplete: 'off', enterkeyhint: 'done', 'aria-label': 'Other words', placeholder: 'other words' }));
    this.bad = html('p', { class: 'bad', role: 'alert' });
    this.yes = html('button', { type: 'button', class: 'key wide solid', 'data-f': 'why-yes' });
    const back = html('button', { type: 'button', class: 'key wide', 'data-f': 'no' }, 'Back');
    this.undo = html('button', { type: 'button', class: 'key wide', 'data-f': 'why-undo' }, 'Take back');
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed dep-why', id: 'sheet-departure', 'aria-labelledby': 'departure-why' },
      html('div', { class: 'bd' }, this.title, html('p', { class: 'sub' }, 'Why? The reason becomes part of the report.')),
      html('div', { class: 'keys' }, this.verdicts, this.chips, html('div', { class: 'field' }, icon('edit'), this.words), this.bad,
        html('div', { class: 'pair' }, back, this.yes), this.undo)));
    show(this.verdicts, item.group !== 'automatic');
    show(this.undo, item.result !== 'open' && !(item.group === 'automatic' && item.result !== 'not_applicable'));
    const stop = addSheet(this.sheet);
    this.sheet.addEventListener('close', () => stop(), { once: true });
    this.yes.addEventListener('click', () => void this.#send(this.#verdict, this.#note));
    this.undo.addEventListener('click', () => void this.#send('open', ''));
    this.words.addEventListener('input', () => this.#choose(''));
    this.words.addEventListener('keydown', (event) => event.key === 'Enter' && void this.#send(this.#verdict, this.#note));
    this.#turn(item.result === 'failed' && item.group !== 'automatic' ? 'failed' : 'not_applicable');
    openSheet(this.sheet);
    this.title.focus();
  }

  get #note() {
    return this.#reason || this.words.value.trim();
  }

  #verdictKeys() {
    return /** @type {Verdict[]} */ (['not_applicable', 'failed']).map((verdict) => {
      const key = html('button', { type: 'button', 'data-verdict': verdict }, TITLES[verdict]);
      key.addEventListener('click', () => this.#turn(verdict));
      return key;
    });
  }

  /** @param {Verdict} verdict */
  #turn(verdict) {
    this.#verdict = verdict;
    this.#reason = '';
    this.chips.replaceChildren(...REASONS[verdict].filter((reason) => reason !== 'Not due yet' || intervalWords(this.item)).map((reason) => {
      const chip = html('button', { type: 'button', class: 'key', 'data-reason': reason }, reason);
      chip.addEventListener('click', () => this.#choose(this.#reason === reason ? '' : reason));
      return chip;
    }));
    this.#draw();
  }

  /** @param {string} reason */
  #choose(reason) {
    this.#reason = reason;
    if (reason) this.words.value = '';
    this.#draw();
  }

  #draw() {
    setText(this.title, `${TITLES[this.#verdict]}: ${this.item.title}`);
    setText(this.yes, TITLES[this.#verdict]);
    setAttribute(this.yes, 'aria-disabled', this.#note ? null : 'true');
    for (const key of this.verdicts.children) setAttribute(key, 'aria-pressed', String(key.getAttribute('data-verdict') === this.#verdict));
    for (const chip of this.chips.children) setAttribute(chip, 'aria-pressed', String(chip.getAttribute('data-reason') === this.#reason));
  }

  /** @param {Item['result']} result @param {string} note */
  async #send(result, note) {
    if (result !== 'open' && !note) return setText(this.bad, 'Choose a reason, or type one.');
    const why = await this.set(result, note);
    if (why === null) closeSheet(this.sheet);
    else setSentence(this.bad, why);
  }
}
