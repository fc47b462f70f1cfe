// One threshold: its name, its number to type into, its slider with the default's tick; or a switch where it is on or off.

import { html, listen, setAttribute, setText, setSentence, show, textNodes } from '../core/dom.js';
import { POSITIONS, SWITCH, endText, readNumber, scaleOf, shareOf, stepped, textOf, valueAt } from './settings-layout.js';
import { SettingsTrace } from './settings-trace.js';
import { speedUnit } from '../core/units.js';
import { SPECS } from '../home/trends-layout.js';

/**
 * @typedef {import('./settings-layout.js').Field} Field
 * @typedef {import('./settings-model.js').SettingsModel} SettingsModel
 */

/** A value at rest for so long is meant, though the finger still lies on it [ms]. */
const REST_MS = 400;
/** A confirmation that takes longer is shown as text [ms]. */
const LONG_MS = 1000;
const KEYS = /** @type {Record<string, number>} */ ({ ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 });

/** A row; `draw` is called as often as the page draws, `texts` is what a search looks at. */
export class SettingsRow {
  /** The value under the finger that is not requested yet, in SI. @type {number | null} */
  #moving = null;
  /** What was in force when the hand took it. @type {number | null} */
  #from = null;
  /** The last value requested by this page, which may come in force while the slider is still moved. @type {number | null} */
  #sent = null;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #rest;
  #asked_ms = 0;
  #drawn = '';

  /**
   * @param {SettingsModel} model
   * @param {string} name
   * @param {Field} field
   */
  constructor(model, name, field) {
    this.model = model;
    this.name = name;
    this.field = field;
    this.texts = [field.title, field.description, field.heading, field.unit, speedUnit(), name];
    const id = `set-${name.replaceAll('.', '-')}`;
    this.message = html('p', { class: 'msg', role: 'status', hidden: true });
    this.yet = html('p', { class: 'yet', hidden: true }, 'Not confirmed by the server yet.');
    this.isSwitch = field.unit === SWITCH;
    const help = field.description ? html('p', { class: 'help', id: `${id}-help` }, ...textNodes(field.description)) : '';
    const described = field.description ? `${id}-help` : null;
    this.number = /** @type {HTMLInputElement} */ (html('input', {
      class: 'n v', id, type: 'text', inputmode: field.minimum < 0 ? 'text' : 'decimal', autocomplete: 'off', enterkeyhint: 'done', size: 4, maxlength: 24,
      'aria-describedby': described,
    }));
    this.unit = html('span', { class: 'u' });
    this.slider = /** @type {HTMLInputElement} */ (html('input', {
      type: 'range', min: 0, max: POSITIONS, step: 1, 'aria-label': `${field.title}, slider`, 'aria-describedby': described,
    }));
    this.usual = html('button', { type: 'button', class: 'usual' }, html('span', { class: 'text' }));
    this.low = html('span', { class: 'n low', 'aria-hidden': 'true' });
    this.high = html('span', { class: 'n high', 'aria-hidden': 'true' });
    this.toggle = html('button', { type: 'button', class: 'toggle', id, role: 'switch', 'aria-checked': 'false', 'aria-describedby': described },
      html('span', { class: 'knob' }), html('span', { class: 'text' }));
    this.range = html('div', { class: 'range' }, html('span', { class: 'line' }), html('span', { class: 'on' }), html('span', { class: 'tick' }), this.low, this.high, this.usual, this.slider);
    this.element = html('div', { class: 'set', 'data-setting': name },
      html('div', { class: 'row' }, html('label', { class: 't', for: id }, field.title), ...(this.isSwitch ? [this.toggle] : [this.number, this.unit])),
      help, ...(this.isSwitch ? [] : [this.range]), this.yet, this.message);
    const spec = SPECS.find(({ limit }) => limit === name);
    this.trace = spec ? new SettingsTrace(model.store, spec) : null;
    if (this.trace) this.range.before(this.trace.element);
    this.stops = this.#listen();
  }

  #listen() {
    return [
      listen(this.slider, 'input', () => this.#move(valueAt(Number(this.slider.value) / POSITIONS, this.field))),
      listen(this.slider, 'change', () => this.#ask()),
      listen(this.slider, 'keydown', (event) => this.#key(event)),
      listen(this.number, 'change', () => this.#typed()),
      listen(this.number, 'keydown', (event) => {
        if (event.key === 'Enter') this.number.blur();
        if (event.key === 'Escape') {
          this.number.value = textOf(this.#shown(), this.field);
          this.number.blur();
        }
      }),
      listen(this.number, 'focus', () => this.number.select()),
      listen(this.number, 'blur', () => this.draw()),
      listen(this.usual, 'click', () => void this.#send(null)),
      listen(this.toggle, 'click', () => void this.#send(this.#shown() ? 0 : 1)),
    ];
  }

  /** What stands in the row now, in SI. */
  #shown() {
    return this.#moving ?? this.model.pending(this.name) ?? this.model.inForce(this.name);
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const steps = KEYS[event.key];
    const now = this.#shown();
    if (now === null || !(steps || event.key === 'Home' || event.key === 'End')) return;
    event.preventDefault();
    this.#move(event.key === 'Home' ? this.field.minimum : event.key === 'End' ? this.field.maximum : stepped(now, steps ?? 0, this.field));
  }

  /** The operator moves it: it is shown as not confirmed, and requested once it rests. @param {number} value */
  #move(value) {
    if (!this.model.isOpen) return;
    if (this.#moving === null) this.#from = this.model.inForce(this.name);
    this.#moving = value;
    this.#say('');
    clearTimeout(this.#rest);
    this.#rest = setTimeout(() => this.#ask(), REST_MS);
    this.draw();
  }

  #ask() {
    clearTimeout(this.#rest);
    if (this.#moving !== null) void this.#send(this.#moving);
  }

  #typed() {
    const read = readNumber(this.number.value, this.field);
    if ('refused' in read) this.#say(`${read.refused} The value is unchanged.`);
    else if (textOf(read.value, this.field) !== textOf(this.#shown(), this.field)) void this.#send(read.value);
    else this.#say('');
    this.number.value = textOf(this.#shown(), this.field);
  }

  /** @param {number | null} value null: back to the default */
  async #send(value) {
    this.#asked_ms = performance.now();
    this.#say('');
    const asking = this.model.set({ values: { [this.name]: value } }, this.name);
    this.#sent = this.model.pending(this.name);
    this.#moving = this.#from = null;
    this.draw();
    const outcome = await asking;
    if (!outcome.ok) this.#say(`Not changed. ${outcome.reason}`);
    this.draw();
  }

  /** @param {string} sentence */
  #say(sentence) {
    setSentence(this.message, sentence);
    show(this.message, sentence !== '');
    setAttribute(this.element, 'data-refused', sentence !== '');
  }

  draw() {
    const { model, name, field } = this;
    this.trace?.draw();
    const inForce = model.inForce(name);
    if (this.#moving !== null && (!model.isOpen || (this.#from !== null && inForce !== null && inForce !== this.#from && inForce !== this.#sent))) {
      clearTimeout(this.#rest);
      this.#moving = this.#from = null;
      this.#say(model.isOpen ? `Another page set it to ${textOf(inForce, field)} ${scaleOf(field).unit} meanwhile.` : 'Not changed: the server does not answer.');
    }
    const value = this.#shown();
    const usual = model.body?.defaults[name] ?? field.default;
    const isOpen = this.#moving !== null || model.pending(name) !== null;
    const isLong = model.pending(name) !== null && this.#moving === null && performance.now() - this.#asked_ms > LONG_MS;
    const key = [value, usual, isOpen, isLong, speedUnit(), document.activeElement === this.number].join();
    if (key === this.#drawn) return;
    this.#drawn = key;
    setAttribute(this.element, 'data-open', isOpen);
    show(this.yet, isLong);
    setAttribute(this.element, 'data-own', value !== usual);
    if (this.isSwitch) {
      setAttribute(this.toggle, 'aria-checked', String(value === 1));
      setText(/** @type {HTMLElement} */ (this.toggle.lastChild), value === null ? '–' : value === 1 ? 'On' : 'Off');
      return;
    }
    const text = textOf(value, field);
    const { unit } = scaleOf(field);
    if (document.activeElement !== this.number) {
      this.number.value = text;
      this.number.size = Math.max(2, text.length);
    }
    setText(this.unit, unit);
    setText(this.low, endText(field.minimum, field));
    setText(this.high, endText(field.maximum, field));
    const share = value === null ? 0 : shareOf(value, field);
    if (Number(this.slider.value) !== Math.round(share * POSITIONS)) this.slider.value = String(Math.round(share * POSITIONS));
    setAttribute(this.slider, 'aria-valuetext', `${text} ${unit}${isOpen ? ', not confirmed yet' : ''}`);
    const at = shareOf(usual, field);
    this.range.style.setProperty('--at', share.toFixed(4));
    this.range.style.setProperty('--usual', at.toFixed(4));
    setAttribute(this.range, 'data-usual', at < 0.17 ? 'low' : at > 0.83 ? 'high' : 'middle');
    setSentence(/** @type {HTMLElement} */ (this.usual.lastChild), `default ${endText(usual, field)}`);
    setAttribute(this.usual, 'aria-label', `${field.title}: default ${endText(usual, field)} ${unit}, press to reset`);
  }

  stop() {
    clearTimeout(this.#rest);
    this.trace?.stop();
    for (const stop of this.stops) stop();
  }
}
