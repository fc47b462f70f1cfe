// What people who are off duty by now left acknowledged: the next who signs on reads each line and takes it over.

import { LineRow } from './handover-sheet.js';
import { leftLines } from './handover-layout.js';
import { html, icon, setAttribute, setText, setSentence } from '../core/dom.js';
import { Meant } from '../core/meant.js';
import { styled } from '../core/style-sheet.js';
import { addSheet, closeSheet, openSheet } from '../shell/sheet.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('../core/protocol-types.js').HandoverLine} HandoverLine
 */

export class LeftSheet {
  /** @type {Map<string, LineRow>} */
  #rows = new Map();
  /** Alarms that were taken over here. @type {Set<string>} */
  #taken = new Set();
  #meant = new Meant();
  #lines = '';

  /** @param {Store} store @param {() => void} onSilent it was closed because nothing came from the server: nobody has read it */
  constructor(store, onSilent) {
    void styled('people');
    this.store = store;
    this.onSilent = onSilent;
    this.count = html('span', { class: 'sub' });
    this.list = html('ul', { class: 'read-back', 'aria-label': 'Alarms without an owner on duty' });
    this.#meant.element = this.list;
    this.bad = html('p', { class: 'bad', role: 'alert' });
    this.keyTitle = html('b');
    this.key = html('button', { type: 'button', class: 'main sign', 'data-f': 'left-done' }, this.keyTitle);
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed duty-sheet', id: 'sheet-left', 'aria-labelledby': 'left-title', 'aria-describedby': 'left-words' },
      html('div', { class: 'duty-head' }, html('h2', { id: 'left-title', tabindex: '-1' }, 'Left behind'), this.count, html('button', { type: 'button', class: 'btn', 'aria-label': 'Close', 'data-f': 'no' }, icon('close'))),
      html('div', { class: 'duty-body', tabindex: '0', role: 'group', 'aria-label': 'Alarms without an owner' },
        html('p', { class: 'sub', id: 'left-words' }, 'Active alarms, acknowledged by people who are off duty. Press each line: from then on it is yours.'), this.list),
      html('div', { class: 'duty-keys' }, this.bad, this.key)));
    const stops = [store.on('draw', () => this.#draw()), addSheet(this.sheet)];
    this.sheet.addEventListener('close', () => stops.forEach((stop) => stop()), { once: true });
    this.key.addEventListener('click', () => closeSheet(this.sheet));
    openSheet(this.sheet);
    /** @type {HTMLElement} */ (this.sheet.querySelector('h2')).focus();
    this.#draw();
  }

  #draw() {
    const { frame, duty } = this.store;
    if (!this.sheet.open) return undefined;
    if (this.store.isSilent) {
      this.onSilent();
      return closeSheet(this.sheet);
    }
    const lines = frame && duty?.me ? leftLines(frame.alarms, duty.me, this.#taken) : [];
    if (lines.length === 0) return closeSheet(this.sheet); // they ended, or somebody else took them
    const left = lines.filter(({ read }) => !read).length;
    setText(this.count, `${lines.length - left} of ${lines.length} taken over`);
    setText(this.keyTitle, left ? 'Later' : 'Done');
    this.#drawLines(lines);
    return undefined;
  }

  /** @param {HandoverLine[]} lines */
  #drawLines(lines) {
    const next = lines.find(({ read }) => !read)?.key;
    const keys = lines.map(({ key }) => key);
    if (keys.join('\n') !== this.#lines) this.#meant.moved();
    this.#lines = keys.join('\n');
    for (const [key, row] of this.#rows) {
      if (keys.includes(key)) continue;
      row.element.remove();
      this.#rows.delete(key);
    }
    lines.forEach((line, i) => {
      const row = this.#rows.get(line.key) ?? new LineRow(line, (shown, event) => void this.#take(shown, event), true, 'Take');
      this.#rows.set(line.key, row);
      row.draw(line, line.key === next);
      setAttribute(row.tick, 'aria-label', `Take over: ${line.title}`);
      if (this.list.children[i] !== row.element) this.list.insertBefore(row.element, this.list.children[i] ?? null);
    });
  }

  /** @param {HandoverLine} line @param {Event} event */
  async #take(line, event) {
    if (!this.#meant.by(event) || line.read) return;
    const [alarm = '', occurrence = ''] = line.key.split(' ');
    setText(this.bad, '');
    const answer = await this.store.ask('take_alarm', { vehicle: this.store.vehicle, alarm, occurrence: Number(occurrence) });
    if (answer.ok) this.#taken.add(line.key);
    else setSentence(this.bad, answer.reason ?? 'Refused.');
  }
}
