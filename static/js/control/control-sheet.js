// The sheet behind the chip: who is in control, how this page gets it or gives it away, and who would hear an alarm.

import { reachOf, sheetOf } from './control-layout.js';
import { html, icon, setText, setSentence, show, textNodes } from '../core/dom.js';
import { addSheet, openSheet } from '../shell/sheet.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('./control.js').Control} Control
 */

/** @param {Store} store @param {Control} control */
export function openControl(store, control) {
  new ControlSheet(store, control);
}

class ControlSheet {
  #drawn = '';
  #isConfirming = false;

  /** @param {Store} store @param {Control} control */
  constructor(store, control) {
    this.store = store;
    this.control = control;
    this.title = html('h2', { id: 'control-title' });
    this.text = html('p', { class: 'sub', id: 'control-words', role: 'status' });
    this.people = html('ul', { class: 'menu-list people' });
    this.keys = html('div', { class: 'acts', 'data-f': 'keys' });
    this.reach = html('button', { type: 'button', class: 'reach' });
    const foot = html('div', { class: 'keys' }, this.keys, html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close'));
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-control', 'aria-labelledby': 'control-title', 'aria-describedby': 'control-words' },
      html('div', { class: 'bd' }, this.title, this.text), this.people, this.reach, foot));
    const stops = [store.on('draw', () => this.#draw()), addSheet(this.sheet)];
    this.reach.addEventListener('click', () => control.openPhone());
    this.sheet.addEventListener('close', () => stops.forEach((stop) => stop()), { once: true });
    openSheet(this.sheet);
    this.#draw();
  }

  #draw() {
    const { control: now, frame, page } = this.store;
    const alarmReach = frame?.replay ? frame.live?.reach : frame?.reach;
    if (!now || !this.sheet.open) return;
    const seen = sheetOf(now, alarmReach, page);
    if (seen.state !== 'other' && seen.state !== 'asking') this.#isConfirming = false;
    setText(this.title, this.#isConfirming ? `Take over from ${now.holder}?` : seen.title);
    setSentence(this.text, this.#isConfirming ? `${now.holder} may be about to act. Taking over is announced to everyone and logged.` : seen.text);
    const line = reachOf(alarmReach);
    this.reach.replaceChildren(icon(line.isBad ? 'bell-off' : 'bell', 's'), html('span', {}, html('b', {}, ...textNodes(line.text)), ...(line.why ? [html('br'), html('span', { class: 'small sub' }, ...textNodes(line.why))] : [])), icon('next', 's'));
    const key = JSON.stringify([seen.state, this.#isConfirming, seen.handTo.map((one) => [one.page, one.name, one.can, one.why_text])]);
    if (key === this.#drawn) return;
    this.#drawn = key;
    const hasFocus = this.keys.contains(document.activeElement);
    this.keys.replaceChildren(...this.#keysOf(seen.state));
    show(this.people, seen.handTo.length > 0);
    this.people.replaceChildren(...seen.handTo.map((one) => this.#personRow(one)));
    if (hasFocus) this.keys.querySelector('button')?.focus();
  }

  /** @param {ReturnType<typeof sheetOf>['handTo'][number]} person */
  #personRow({ page, name, can, why_text }) {
    const hearing = can ? 'alarms audible' : `alarms not audible: ${why_text ?? 'unknown'}`;
    const button = html('button', { type: 'button', 'data-page': page }, icon('operator'), html('span', {}, `Hand over to ${name}`, html('br'), html('span', { class: 'small sub' }, hearing)));
    button.addEventListener('click', () => void this.control.handOver(page).then(({ ok }) => ok && this.sheet.close()));
    return html('li', {}, button);
  }

  /** @param {string} state */
  #keysOf(state) {
    const key = (/** @type {string} */ label, /** @type {() => void} */ act, kind = 'key wide') => {
      const button = html('button', { type: 'button', class: kind }, ...textNodes(label));
      button.addEventListener('click', act);
      return button;
    };
    const order = (/** @type {import('../core/protocol-types.js').TakeControlCommand['do']} */ act) => () => void this.#order(act);
    if (state === 'free') return [key('Take control', order('take'), 'main')];
    if (state === 'you') return [key('Give up control', order('release'))];
    if (this.#isConfirming) return [key('Take over', order('take_over'), 'main'), key('Back', () => this.#confirm(false))];
    return [
      state === 'asking' ? key('Cancel request', order('withdraw')) : key('Request control', order('request'), 'main'),
      key('Take over …', () => this.#confirm(true)),
    ];
  }

  /** @param {boolean} isConfirming */
  #confirm(isConfirming) {
    this.#isConfirming = isConfirming;
    this.#draw();
  }

  /** @param {import('../core/protocol-types.js').TakeControlCommand['do']} act @param {{to?: string | null}} [fields] */
  async #order(act, fields) {
    const answer = await this.control.order(act, fields);
    this.#isConfirming = false;
    if (answer.ok && act !== 'request') this.sheet.close();
    else this.#draw();
  }
}
