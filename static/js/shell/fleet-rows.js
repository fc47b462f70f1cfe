// The rows of all cars, a page at a time, and the grid in which each car has its place. Rows are kept by their car.

import { drawChain } from './chain.js';
import { arrange } from './fleet-queue.js';
import { field, html, icon, listen, setAttribute, setIcon, setText, setSentence, show, svg } from '../core/dom.js';
import { write } from '../core/ink.js';
import { Meant } from '../core/meant.js';
import { speedUnit, speedWords } from '../core/units.js';

/**
 * @typedef {import('./fleet-rows-layout.js').Row} Row
 */

/** The page of one car. @param {string} name */
export function addressOf(name) {
  return `/?vehicle=${encodeURIComponent(name)}`;
}

export class Rows {
  #page = 0;
  /** @type {Map<string, RowView>} */
  #views = new Map();
  /** @type {Row[]} */
  #rows = [];
  #aPage = 16;

  /** @param {HTMLElement} root @param {(row: Row) => void} press @param {(name: string, key: HTMLElement) => void} endStop */
  constructor(root, press, endStop) {
    this.press = press;
    this.endStop = endStop;
    this.body = field(root, 'body');
    this.unit = field(root, 'speed-unit');
    this.pager = field(root, 'rows-pager');
    this.before = field(root, 'rows-before');
    this.after = field(root, 'rows-after');
    this.pages = field(root, 'rows-pages');
    listen(this.before, 'click', () => this.#turn(-1));
    listen(this.after, 'click', () => this.#turn(1));
  }

  /** @param {Row[]} rows @param {number} aPage so many on one page */
  draw(rows, aPage) {
    this.#rows = rows;
    this.#aPage = aPage;
    const last = Math.max(0, Math.ceil(rows.length / aPage) - 1);
    this.#page = Math.min(this.#page, last);
    const from = this.#page * aPage;
    const shown = rows.slice(from, from + aPage);
    setText(this.unit, speedUnit());
    const views = shown.map((row, i) => {
      const view = this.#views.get(row.key) ?? new RowView(() => this.press(view.row), this.endStop);
      this.#views.set(row.key, view);
      view.draw(row, i);
      return view.element;
    });
    arrange(this.body, views);
    const known = new Set(rows.map(({ key }) => key));
    for (const key of this.#views.keys()) if (!known.has(key)) this.#views.delete(key);
    show(this.pager, last > 0);
    setSentence(this.pages, `${from + 1}–${from + shown.length} of ${rows.length}`);
    setAttribute(this.before, 'aria-disabled', this.#page === 0 ? 'true' : null);
    setAttribute(this.after, 'aria-disabled', this.#page === last ? 'true' : null);
  }

  /** @param {number} by */
  #turn(by) {
    const last = Math.max(0, Math.ceil(this.#rows.length / this.#aPage) - 1);
    this.#page = Math.min(last, Math.max(0, this.#page + by));
    this.draw(this.#rows, this.#aPage);
  }
}

class RowView {
  mark = icon('ok');
  markWords = html('span', { class: 'unseen' });
  link = html('a');
  text = html('span');
  end = html('button', { type: 'button', class: 'key', 'data-act': 'end-stop', hidden: true });
  chain = svg('svg', { class: 'chain', viewBox: '0 0 84 24', role: 'img' });
  speed = html('span', { class: 'n' });
  mode = html('td', { class: 'mo' });
  operator = html('td', { class: 'op' });
  rec = icon('rec', 's');
  recWords = html('span', { class: 'unseen' });
  energy = html('span', { class: 'n' });
  age = html('span', { class: 'n' });
  /** @type {Row} */
  row = /** @type {any} */ (null);
  #index = -1;
  #meant = new Meant();

  /** @param {() => void} press @param {(name: string, key: HTMLElement) => void} endStop */
  constructor(press, endStop) {
    const cell = (/** @type {string} */ name, /** @type {(Node | string)[]} */ ...inside) => html('td', { class: name }, ...inside);
    this.element = html('tr', {}, cell('mk', this.mark, this.markWords), html('th', { class: 'nm', scope: 'row' }, this.link), cell('al', html('div', {}, this.text, this.end)), cell('ch', this.chain),
      cell('sp', this.speed), this.mode, this.operator, cell('rc', this.rec, this.recWords), cell('en', this.energy), cell('ag', this.age));
    this.#meant.element = this.end;
    this.end.addEventListener('click', (event) => {
      event.stopPropagation();
      if ((event.detail === 0 || this.#meant.by(event)) && !this.end.hasAttribute('data-busy')) endStop(this.row.name, this.end);
    });
    this.element.addEventListener('click', (event) => {
      const isPlain = !(event.metaKey || event.ctrlKey || event.shiftKey || event.button);
      if (event.target === this.link && (!isPlain || this.row.cars.length === 1)) return; // the browser follows it
      event.preventDefault();
      press();
    });
  }

  /** @param {Row} row @param {number} index */
  draw(row, index) {
    this.row = row;
    if (this.#index !== index || this.end.hidden === row.isStopped) this.#meant.moved();
    this.#index = index;
    show(this.end, row.isStopped);
    setText(this.end, row.isStopped ? 'End stop' : '');
    setAttribute(this.end, 'aria-label', `End the planned stop: ${row.name}`);
    const { element, link } = this;
    setAttribute(element, 'data-car', row.key);
    setAttribute(element, 'data-kind', row.kind || null);
    setAttribute(element, 'data-asking', row.isAsking);
    setAttribute(element, 'data-lost', row.isLost);
    setAttribute(element, 'data-quiet', row.isQuiet);
    setIcon(this.mark, row.icon);
    setAttribute(this.mark, 'visibility', row.icon === 'ok' ? 'hidden' : null);
    setText(this.markWords, row.kind === 'crit' ? 'critical' : row.kind === 'warn' ? 'warning' : '');
    setText(link, row.name);
    setAttribute(link, 'href', row.cars.length === 1 ? addressOf(row.name) : '#cars');
    setSentence(this.text, row.text);
    drawChain(this.chain, row.chain);
    setAttribute(this.chain, 'aria-label', row.chain.cut === null ? 'whole' : 'cut');
    const isKnown = row.speed.value_mps !== null && row.speed.ink !== 'never' && row.speed.ink !== 'not_published';
    write(this.speed, isKnown ? row.speed.ink : 'fresh', speedWords(isKnown ? row.speed.value_mps : null)[0]);
    setAttribute(this.speed, 'data-unit', isKnown ? speedUnit() : null);
    setText(this.mode, row.mode);
    setText(this.operator, row.operator);
    setAttribute(this.rec, 'class', row.isRecording ? 'i s fill' : 'i s');
    setText(this.recWords, row.isRecording ? `recording ${row.recording}` : row.recording);
    write(this.energy, row.energy.ink, row.energy.text);
    setText(this.age, row.age);
    setAttribute(this.age, 'data-unit', row.age === '–' || row.age.includes(':') ? null : 's');
  }
}

/** The grid: each car in its place, whatever happens. */
export class Places {
  /** @type {Map<string, {element: HTMLElement, link: HTMLElement, label: HTMLElement, mark: SVGElement}>} */
  #cells = new Map();

  /** @param {HTMLElement} root */
  constructor(root) {
    this.list = field(root, 'places');
  }

  /** @param {ReturnType<typeof import('./fleet-rows-layout.js').placesOf>} places */
  draw(places) {
    const elements = places.map((place) => {
      const cell = this.#cells.get(place.name) ?? this.#made(place.name);
      setText(cell.label, place.label);
      setAttribute(cell.link, 'data-kind', place.kind || null);
      setAttribute(cell.link, 'data-known', place.isKnown);
      setAttribute(cell.link, 'data-drives', place.isDriving);
      setAttribute(cell.link, 'aria-label', place.title);
      show(cell.mark, place.kind !== '');
      if (place.kind) setIcon(cell.mark, place.kind === 'lost' ? 'link-off' : place.kind);
      return cell.element;
    });
    arrange(this.list, elements);
  }

  /** @param {string} name */
  #made(name) {
    const label = html('span', { class: 'n' });
    const mark = icon('crit');
    const link = html('a', { href: addressOf(name) }, label, mark);
    const cell = { element: html('li', {}, link), link, label, mark };
    this.#cells.set(name, cell);
    return cell;
  }
}
