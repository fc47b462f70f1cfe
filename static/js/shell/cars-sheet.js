// The cars of this server, the one that needs a person most first; a press opens one. Made when it is wanted.

import { drawChain } from './chain.js';
import { addSheet, closeSheet, openSheet } from './sheet.js';
import { chipOf, controlWords } from '../control/control-layout.js';
import { dutyWords } from '../control/duty-layout.js';
import { html, icon, setAttribute, setIcon, setText, setSentence, show, svg } from '../core/dom.js';
import { write } from '../core/ink.js';
import { speedWords } from '../core/units.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('./cars-layout.js').CarRow} CarRow
 */

/**
 * @param {Store} store
 * @param {object} page
 * @param {() => CarRow[]} page.rows
 * @param {(name: string) => void} page.open
 * @param {() => void} page.openControl
 * @param {() => void} page.openDuty
 */
export function openCars(store, { rows, open, openControl, openDuty }) {
  const speed = html('span', { class: 'n' });
  const unit = html('span', { class: 'u' });
  const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close', 'data-f': 'no' }, icon('close'));
  const list = html('ul', { class: 'cars' });
  const effect = html('p', { class: 'sub small' });
  const control = html('button', { type: 'button', class: 'key wide', 'data-f': 'cars-control' }, icon('operator'), html('span'));
  const duty = html('button', { type: 'button', class: 'key wide', 'data-f': 'cars-duty' }, icon('operator'), html('span'));
  const fleet = html('a', { class: 'pick-link', href: '/fleet', 'data-f': 'cars-fleet' }, 'Fleet: what needs a person');
  const sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-cars', 'aria-labelledby': 'cars-title' },
    html('div', { class: 'cars-head' }, html('h2', { id: 'cars-title' }, 'Cars'), html('span', { class: 'speed' }, speed, unit), close),
    list, fleet, html('div', { class: 'keys' }, duty, control, effect)));
  /** @type {Map<string, CarItem>} */
  const items = new Map();

  function draw() {
    const now = rows();
    const own = store.ink('speed');
    const value = store.signal('speed')?.value?.speed_mps ?? null;
    drawSpeed(speed, unit, { ink: own.ink, value_mps: value });
    for (const row of now) {
      if (!items.has(row.name)) items.set(row.name, new CarItem(row.name, (name) => {
        closeSheet(sheet);
        open(name);
      }));
    }
    const wanted = now.map((row) => /** @type {CarItem} */ (items.get(row.name)).draw(row, row.name === store.vehicle));
    if (wanted.some((item, i) => list.children[i] !== item)) {
      const focused = document.activeElement;
      list.replaceChildren(...wanted);
      if (focused instanceof HTMLElement && list.contains(focused)) focused.focus();
    }
    const chip = chipOf(store.control, store.page, store.isSilent, store.duty);
    setText(/** @type {Element} */ (control.lastElementChild), controlWords(chip, store.vehicle, store.isViewer));
    setText(/** @type {Element} */ (duty.lastElementChild), dutyWords(store.duty));
    show(duty, store.duty !== null && !store.isViewer);
    show(fleet, now.length > 1);
    setSentence(effect, now.length > 1 ? `Opening another car moves the slide to it and arms nothing. Control of ${store.vehicle} is given up.` : 'The server watches one car.');
  }

  control.addEventListener('click', () => {
    closeSheet(sheet);
    openControl();
  });
  duty.addEventListener('click', () => {
    closeSheet(sheet);
    openDuty();
  });
  const stops = [store.on('draw', draw), store.on('duty', draw), store.on('cars', draw), addSheet(sheet)];
  sheet.addEventListener('close', () => stops.forEach((stop) => stop()), { once: true });
  draw();
  openSheet(sheet);
}

/** One car. */
class CarItem {
  mark = icon('ok');
  name = html('b');
  open = html('span', { class: 'sub' });
  text = html('span', { class: 't' });
  operator = html('span', { class: 'op' });
  value = html('span', { class: 'n' });
  unit = html('span', { class: 'u' });
  chain = svg('svg', { class: 'chain', viewBox: '0 0 84 24', 'aria-hidden': 'true' });
  age = html('span', { class: 'n age' });
  recording = html('span', { class: 'n' });

  /** @param {string} name @param {(name: string) => void} open */
  constructor(name, open) {
    this.side = html('span', { class: 'mark' }, this.mark);
    this.rec = icon('rec', 's');
    const key = this.key = html('button', { type: 'button', 'data-car': name }, this.side,
      html('span', { class: 'what' }, html('span', { class: 'name' }, this.name, ' ', this.open), this.text,
        html('span', { class: 'sub who' }, icon('operator', 's'), this.operator, html('span', { class: 'rec' }, this.rec, this.recording))),
      html('span', { class: 'how' }, html('span', { class: 'speed' }, this.value, this.unit), this.chain, this.age));
    key.addEventListener('click', () => open(name));
    this.item = html('li', {}, key);
    setText(this.name, name);
  }

  /** @param {CarRow} row @param {boolean} isShown */
  draw(row, isShown) {
    setAttribute(this.item, 'data-kind', row.kind || null);
    setAttribute(this.item, 'data-filled', row.isFilled);
    setAttribute(this.key, 'aria-current', isShown ? 'true' : null);
    setIcon(this.mark, row.icon);
    setText(this.open, isShown ? 'open now' : '');
    setSentence(this.text, row.text);
    setText(this.operator, row.operator);
    drawSpeed(this.value, this.unit, row.speed);
    drawChain(this.chain, row.chain ?? NOTHING);
    setText(this.age, row.age);
    setText(this.recording, row.recording);
    setAttribute(this.rec, 'class', /^\d/.test(row.recording) ? 'i s fill' : 'i s');
    return this.item;
  }
}

/** A speed with its ink; a dash where there is none. @param {HTMLElement} element @param {HTMLElement} unit @param {{ink: import('../core/freshness.js').Ink, value_mps: number | null}} speed */
function drawSpeed(element, unit, { ink, value_mps }) {
  const isKnown = value_mps !== null && ink !== 'never' && ink !== 'not_published';
  const [text, of] = speedWords(isKnown ? value_mps : null);
  write(element, isKnown ? ink : 'fresh', text, unit, of);
}

/** A chain of which only the server is known. @type {import('../core/link.js').ChainView} */
const NOTHING = { state: 'Lost', age_s: null, cut: 0, since_ms: null, nodes: [], sentence: '', detail: '' };
