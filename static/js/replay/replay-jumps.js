// Alarms, marks, interventions and gaps of a recording as a list to jump to: a press leads to some seconds before it.

import { html, icon, listen, setText, setSentence, textNodes } from '../core/dom.js';
import { timeOfDay } from '../core/format.js';
import { shape } from '../drive/drive-parts.js';
import { addSheet, closeSheet, openSheet } from '../shell/sheet.js';
import { clockOf } from './replay-layout.js';
import { LEAD_S, jumpAt, jumpWords, jumpsOf, lengthOfJump, nearestJump } from './replay-jumps-layout.js';

/** @typedef {import('../core/protocol-types.js').Timeline} Timeline */

export class JumpList {
  /** @type {Timeline | null} */
  #line = null;
  #start_ms = 0;
  #source = '';
  #drawn = '';
  #title = html('span', { id: 'jumps-title' });
  #hint = html('p', { class: 'sub' });
  #list = html('ul', { class: 'jumps', 'data-f': 'jumps' });
  #close = html('button', { type: 'button', class: 'key wide', 'data-f': 'no' }, icon('close'), html('span', {}, 'Close'));
  element = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-jumps', 'aria-labelledby': 'jumps-title' },
    html('div', { class: 'bd' }, html('h2', {}, icon('bell'), this.#title), this.#hint), this.#list, html('div', { class: 'keys' }, this.#close)));

  /** @param {(at_s: number) => void} seek */
  constructor(seek) {
    this.seek = seek;
    this.stops = [
      addSheet(this.element),
      listen(this.element, 'keydown', (event) => this.#key(event)),
      listen(this.#list, 'click', (event) => {
        const key = /** @type {HTMLElement | null} */ (event.target.closest('button'));
        if (!key) return;
        closeSheet(this.element);
        this.seek(Number(key.dataset['at']));
      }),
    ];
  }

  unmount() {
    if (this.element.open) this.element.close();
    for (const stop of this.stops) stop();
  }

  /** The time line as far as the server has made it. @param {Timeline} line */
  take(line) {
    this.#line = line;
    if (this.element.open) this.#draw();
  }

  /**
   * @param {import('../core/protocol-types.js').ReplayState} replay the moment that is shown
   */
  open({ at_s, start_ms, alarms_from }) {
    this.#start_ms = start_ms;
    this.#source = alarms_from === 'recording' ? 'Original alarms. ' : 'Re-evaluated alarms. ';
    this.#draw();
    openSheet(this.element);
    const keys = this.#keys();
    const near = keys[nearestJump(keys.map((key) => Number(key.dataset['begins'])), at_s)];
    near?.focus();
    near?.scrollIntoView({ block: 'center' });
  }

  #keys() {
    return [.../** @type {NodeListOf<HTMLElement>} */ (this.#list.querySelectorAll('button'))];
  }

  /** The place of the key that has the focus; −1: none has. */
  get #focused() {
    return this.#keys().indexOf(/** @type {HTMLElement} */ (document.activeElement));
  }

  #draw() {
    const line = this.#line;
    const jumps = line ? jumpsOf(line) : [];
    setText(this.#title, line ? jumpWords(line) : 'Alarms');
    const isPartial = line !== null && !line.is_done;
    const hint = jumps.length ? `${this.#source}Each opens ${LEAD_S} s before it begins.` : isPartial || !line ? '' : 'Nothing was announced or marked in this recording, and nothing is missing.';
    setSentence(this.#hint, `${hint}${isPartial || !line ? ` Read up to ${clockOf(line?.done_s ?? 0)}; later alarms may follow.` : ''}${line?.modes.some(({ mode }) => mode === 'manual') ? ' Shaded on the time line: a person drives.' : ''}`.trim());
    const key = JSON.stringify([jumps, line?.is_done]);
    if (key === this.#drawn) return;
    this.#drawn = key;
    const focused = this.#focused;
    this.#list.replaceChildren(...jumps.map((jump) => html('li', {}, html('button', { type: 'button', 'data-at': jumpAt(jump), 'data-begins': jump.at_s, 'data-kind': jump.kind },
      jump.kind === 'flag' || jump.kind === 'wheel' ? shape(jump.kind) : icon(jump.icon, 's'), html('span', { class: 'n at' }, clockOf(jump.at_s)),
      html('span', { class: 'tx' }, html('b', {}, jump.title), html('span', { class: 'sub' }, ...textNodes(jump.text))),
      html('span', { class: 'lasts' }, html('span', {}, ...textNodes(lengthOfJump(jump, line?.is_done ?? false))), html('span', { class: 'n sub' }, timeOfDay(this.#start_ms + jump.at_s * 1000)))))));
    if (focused >= 0) this.#keys()[focused]?.focus();
  }

  /** Arrow keys go through the list, as in any list. @param {KeyboardEvent} event */
  #key(event) {
    const keys = this.#keys();
    const here = this.#focused;
    const next = /** @type {Record<string, number>} */ ({ ArrowDown: here + 1, ArrowUp: here - 1, Home: 0, End: keys.length - 1 })[event.key];
    if (next === undefined || !keys.length) return;
    event.preventDefault();
    keys[Math.min(Math.max(next, 0), keys.length - 1)]?.focus();
  }
}
