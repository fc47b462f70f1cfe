// A hand-over of control: who takes over reads back each thing that stands and ticks it; who hands over sees how far it is.

import { partOf } from './duty-layout.js';
import { endWords, lineWords, markOf } from './handover-layout.js';
import { styled } from '../core/style-sheet.js';
import { html, icon, setAttribute, setIcon, setText, setSentence, show, svg } from '../core/dom.js';
import { shapeOf } from '../drive/mode-text.js';
import { Meant } from '../core/meant.js';
import { addSheet, closeSheet, openSheet } from '../shell/sheet.js';

/**
 * @typedef {import('../core/protocol-types.js').HandoverState} HandoverState
 * @typedef {import('../core/protocol-types.js').HandoverLine} HandoverLine
 */

export class HandoverSheet {
  /** @type {Map<string, LineRow>} */
  #rows = new Map();
  #which = '';
  #lines = '';
  #meant = new Meant();
  /** Ticks that were sent and are not in a state yet. @type {Map<string, boolean>} */
  #sent = new Map();

  /**
   * @param {import('../core/store.js').Store} store
   * @param {import('./control.js').Say} say
   * @param {(isByHand: boolean) => void} onClosed the hand-over may go on
   */
  constructor(store, say, onClosed) {
    void styled('people');
    this.store = store;
    this.say = say;
    this.count = html('span', { class: 'sub' });
    this.by = html('bdi');
    this.to = html('bdi');
    this.text = html('p', { class: 'sub', id: 'handover-words' });
    this.list = html('ul', { class: 'read-back', 'aria-label': 'What is in force' });
    this.keyTitle = html('b');
    this.keyText = html('span');
    this.key = html('button', { type: 'button', class: 'main sign', 'data-f': 'take-over' }, this.keyTitle, this.keyText);
    this.end = html('button', { type: 'button', class: 'key wide', 'data-f': 'end-offer' });
    this.bad = html('p', { class: 'bad', role: 'alert' });
    const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close', 'data-f': 'no' }, icon('close'));
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed duty-sheet', id: 'sheet-handover', 'aria-labelledby': 'handover-title', 'aria-describedby': 'handover-words' },
      html('div', { class: 'duty-head' }, html('h2', { id: 'handover-title', tabindex: '-1' }, 'Hand over'), this.count, close),
      html('div', { class: 'duty-body', tabindex: '0', role: 'group', 'aria-label': 'What is in force' },
        html('div', { class: 'from-to' }, this.by, icon('next'), this.to), this.text, this.list),
      html('div', { class: 'duty-keys' }, this.bad, this.key, this.end)));
    const stops = [store.on('draw', () => this.#draw()), addSheet(this.sheet)];
    let isByHand = false;
    const byHand = () => { isByHand = true; };
    this.sheet.addEventListener('cancel', byHand);
    close.addEventListener('click', byHand, { capture: true });
    this.sheet.addEventListener('click', (event) => { if (event.target === this.sheet && event.clientY < this.sheet.getBoundingClientRect().top) byHand(); }, { capture: true });
    this.sheet.addEventListener('close', () => {
      stops.forEach((stop) => stop());
      onClosed(isByHand);
    }, { once: true });
    this.key.addEventListener('click', (event) => void this.#accept(event));
    this.end.addEventListener('click', (event) => this.#meant.by(event) && void this.#order('end_offer', {}));
    openSheet(this.sheet);
    /** @type {HTMLElement} */ (this.sheet.querySelector('h2')).focus();
    this.#draw();
  }

  get #now() {
    const handover = this.store.control?.handover ?? null;
    return { handover, part: partOf(handover, this.store.page) };
  }

  #draw() {
    const { handover, part } = this.#now;
    if (!this.sheet.open) return;
    if (!handover || !part || (this.#which && this.#which !== `${handover.since_ms}`)) {
      closeSheet(this.sheet);
      return;
    }
    this.#which = `${handover.since_ms}`;
    const end = endWords(handover, part);
    setText(this.count, `${handover.lines.length - handover.left} of ${handover.lines.length} read back`);
    drawName(this.by, handover.by);
    drawName(this.to, handover.name);
    setSentence(this.text, part === 'taker' ? `Say each line aloud and press it. Control stays with ${handover.by} until the last line.` : `${handover.name} says each line aloud and presses it. You stay in control until the last line.`);
    this.#drawLines(handover, part);
    show(this.key, part === 'taker');
    setText(this.keyTitle, end.title);
    setText(this.keyText, end.text);
    setAttribute(this.key, 'aria-disabled', end.isOpen ? null : 'true');
    setText(this.end, part === 'taker' ? 'Decline' : 'Take the offer back');
  }

  /** Each line keeps its elements as long as it stands: measured values change under a finger. @param {HandoverState} handover @param {'taker' | 'giver'} part */
  #drawLines(handover, part) {
    for (const line of handover.lines) if (this.#sent.get(line.key) === line.read) this.#sent.delete(line.key);
    const next = handover.lines.find(({ read }) => !read)?.key;
    const kept = new Set(handover.lines.map(({ key }) => key));
    const lines = [...kept].join('\n');
    if (lines !== this.#lines) this.#meant.moved();
    this.#lines = lines;
    for (const [key, row] of this.#rows) {
      if (kept.has(key)) continue;
      row.element.remove();
      this.#rows.delete(key);
    }
    handover.lines.forEach((line, i) => {
      const row = this.#rows.get(line.key) ?? new LineRow(line, (shown, event) => void this.#read(shown, event), part === 'taker');
      this.#rows.set(line.key, row);
      row.draw(line, line.key === next);
      if (this.list.children[i] !== row.element) this.list.insertBefore(row.element, this.list.children[i] ?? null);
    });
  }

  /** @param {HandoverLine} line @param {Event} event */
  async #read(line, event) {
    if (!this.#meant.by(event)) return;
    const is_read = !(this.#sent.get(line.key) ?? line.read);
    this.#sent.set(line.key, is_read);
    if (!(await this.#order('read_back', { line: line.key, is_read }))) this.#sent.delete(line.key);
  }

  /** @param {Event} event */
  async #accept(event) {
    const { handover } = this.#now;
    if (!this.#meant.by(event) || !handover || this.key.getAttribute('aria-disabled') === 'true') return;
    await this.#order('accept_control', { version: handover.version });
  }

  /** @param {'read_back' | 'accept_control' | 'end_offer'} kind @param {any} fields */
  async #order(kind, fields) {
    setText(this.bad, '');
    const answer = await this.store.ask(kind, { vehicle: this.store.vehicle, ...fields });
    if (!answer.ok && this.sheet.open) setSentence(this.bad, answer.reason ?? 'Refused.'); // a notice is behind the sheet
    else if (!answer.ok) this.say(answer.reason ?? 'Refused.', 'Not handed over');
    return answer.ok;
  }
}

/** One line, with its tick. */
export class LineRow {
  mark = icon('info');
  title = html('b', { class: 't' });
  text = html('span', { class: 'm' });
  tick = html('button', { type: 'button', class: 'tick' });
  element = html('li', {}, this.mark, this.title, this.text, this.tick);

  /** @param {HandoverLine} line @param {(line: HandoverLine, event: Event) => void} read @param {boolean} isTaker @param {string} [does] what a press on the next one does */
  constructor(line, read, isTaker, does = 'Read') {
    this.line = line;
    this.does = does;
    this.shape = shapeOf(line);
    if (this.shape) this.mark.replaceChildren(svg('path', { d: this.shape })); // that of the ledge
    setAttribute(this.tick, 'data-line', line.key);
    setAttribute(this.tick, 'aria-disabled', isTaker ? null : 'true');
    if (isTaker) this.tick.addEventListener('click', (event) => read(this.line, event));
  }

  /** @param {HandoverLine} line @param {boolean} isNext the one to be read now */
  draw(line, isNext) {
    const face = line.read ? 'read' : isNext ? 'next' : 'open';
    this.line = line;
    if (!this.shape) setIcon(this.mark, markOf(line));
    setAttribute(this.element, 'data-kind', line.priority ?? line.kind);
    setSentence(this.title, line.title);
    setSentence(this.text, lineWords(line));
    setAttribute(this.tick, 'aria-label', `Read back: ${line.title}`);
    setAttribute(this.tick, 'aria-pressed', String(line.read));
    setAttribute(this.tick, 'data-next', face === 'next');
    if (this.tick.dataset['face'] === face) return;
    setAttribute(this.tick, 'data-face', face);
    this.tick.replaceChildren(face === 'read' ? icon('ok') : face === 'next' ? this.does : '');
  }
}

/** A person over the device in brackets. @param {HTMLElement} element @param {string} signed */
function drawName(element, signed) {
  if (element.dataset['signed'] === signed) return;
  setAttribute(element, 'data-signed', signed);
  const [, person = signed, device = ''] = /^(.*?) \((.*)\)$/.exec(signed) ?? [];
  element.replaceChildren(person, html('span', { class: 'sub' }, device));
}
