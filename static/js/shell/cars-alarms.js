// The alarms of the other cars, on the page of one: on the strip, on a card over the rail, aloud and by name.

import { announcedOf, askingOf, keyOf, louder } from './cars-layout.js';
import { field, html, icon, listen, need, setAttribute, setIcon, setText, setSentence } from '../core/dom.js';
import { ageWords, counted } from '../core/format.js';
import { Meant } from '../core/meant.js';

/**
 * @typedef {import('./cars-layout.js').CarRow} CarRow
 */

export class CarsAlarms {
  /** What was left on this phone: a car's alarm, and of it one occurrence. @type {Set<string>} */
  #left = new Set();
  /** What was named aloud. @type {Set<string>} */
  #spoken = new Set();
  /** @type {CarRow | null} */
  #shown = null;
  /** Which one, and whether beside a warning of this car: without one it may come to stand where that did. */
  #place = '';
  #meant = new Meant();

  /**
   * @param {HTMLElement} monitor
   * @param {HTMLElement} snacks where the card stands: over the rail, and in no way of this car's slide
   * @param {import('./cars.js').Cars} cars
   */
  constructor(monitor, snacks, cars) {
    this.cars = cars;
    this.store = cars.store;
    this.snacks = snacks;
    this.strip = field(monitor, 'strip');
    this.open = html('button', { type: 'button', class: 'key solid' });
    this.leave = html('button', { type: 'button', class: 'key' }, 'Leave it');
    this.title = html('b', { id: 'other-title' });
    this.text = html('span');
    this.card = html('div', { class: 'snack prompt other', role: 'alertdialog', 'aria-labelledby': 'other-title', 'data-f': 'other-car' },
      html('div', { class: 'side' }, icon('crit')), html('div', { class: 'tx' }, this.title, this.text), html('div', { class: 'ac' }, this.leave, this.open));
    const meant = (/** @type {(row: CarRow) => void} */ act) => (/** @type {Event} */ event) => {
      if (this.#shown && this.#meant.by(event)) act(this.#shown);
    };
    this.stops = [
      listen(this.open, 'click', meant((row) => cars.open(row.name))),
      listen(this.leave, 'click', meant((row) => {
        this.#left.add(keyOf(row));
        this.draw();
      })),
      listen(this.strip, 'click', (event) => {
        if (this.strip.dataset['opens'] !== 'cars') return;
        event.stopImmediatePropagation();
        cars.openList();
      }, { capture: true }),
      cars.store.on('draw', () => this.draw()),
      cars.store.on('cars', () => this.draw()),
    ];
    cars.onListed = () => this.#seen();
  }

  /** The alarms of other cars that ask for a person on this phone; the worst first. */
  get asking() {
    const { cars, store } = this;
    return store.cars && !store.isSilent ? askingOf(cars.rows(), store.vehicle, this.#left) : [];
  }

  /** The other cars whose next alarm this phone would announce. */
  get announced() {
    const { cars, store } = this;
    return store.cars && !store.isSilent ? announcedOf(cars.rows(), store.vehicle, this.#left) : [];
  }

  /** The list of cars shows them all: what is no more than a warning need not sound any longer. */
  #seen() {
    for (const row of this.asking) if (row.worst?.priority !== 'critical') this.#left.add(keyOf(row));
  }

  /** @param {Parameters<typeof louder>[0]} own what this car's alarms need */
  sound(own) {
    return louder(own, this.asking);
  }

  draw() {
    const { asking, store } = this;
    this.#drawStrip(asking);
    const critical = asking.find(({ worst }) => worst?.priority === 'critical') ?? null;
    this.#drawCard(document.querySelector('#sheet-cars[open]') ? null : critical); // the list begins with the same row
    if (!store.painter.drawing.isFailed) for (const row of asking) this.#speak(row);
  }

  /** The strip names another car where this one has nothing worse; strip.js has drawn this car's. @param {CarRow[]} asking */
  #drawStrip(asking) {
    const { strip } = this;
    const [first] = asking;
    if (!first || !isLess(strip.dataset['kind'] ?? '', first.kind)) return;
    setAttribute(strip, 'data-kind', first.kind || null);
    setAttribute(strip, 'data-returned', false);
    setAttribute(strip, 'data-known', false);
    setAttribute(strip, 'data-opens', 'cars');
    setIcon(need(strip, '.i'), first.icon);
    setSentence(field(strip, 'strip-text'), `${this.cars.shortOf(first.name)}: ${first.worst?.title ?? ''}`);
    setSentence(field(strip, 'strip-end'), asking.length > 1 ? counted(asking.length, 'car') : ageWords(this.#for_s(first)));
  }

  /** For how long its worst alarm is raised [s]. @param {CarRow} row */
  #for_s({ worst }) {
    const { cars, carsLag_s } = this.store;
    return Math.max(0, ((cars?.time_ms ?? 0) - (worst?.raised_ms ?? 0)) / 1000 + carsLag_s);
  }

  /** @param {CarRow | null} row */
  #drawCard(row) {
    const { card, snacks } = this;
    if (!row?.worst) {
      this.#shown = null;
      card.remove();
      return;
    }
    const warning = field(snacks, 'warning');
    const place = `${keyOf(row)} ${warning.hidden}`;
    if (!this.#shown || place !== this.#place) this.#meant.moved();
    this.#place = place;
    this.#shown = row;
    const short = this.cars.shortOf(row.name); // whole in the list of cars
    const { title, text } = row.worst;
    setSentence(this.title, `${short}: ${text || title}`);
    setSentence(this.text, `${text ? `${title}, for` : 'For'} ${ageWords(this.#for_s(row))}. In control: ${row.operator}.`);
    setText(this.open, `Open ${short}`);
    if (!card.isConnected) warning.after(card); // where there is room for one, this car's comes first
  }

  /** Names a car and its alarm, once each occurrence, where the browser has a voice. @param {CarRow} row */
  #speak(row) {
    const key = keyOf(row);
    if (this.#spoken.has(key) || !row.worst) return;
    this.#spoken.add(key);
    try {
      const { speechSynthesis: voice } = window;
      if (voice?.getVoices().length) voice.speak(new SpeechSynthesisUtterance(`${row.name}: ${row.worst.title}`));
    } catch (error) {
      console.warn('No voice:', error);
    }
  }
}

const WEIGHT = { '': 0, warn: 2, invert: 3, order: 4, crit: 5 };

/** Whether what this car's strip shows is less than an alarm of another. @param {string} own @param {CarRow['kind']} other */
export function isLess(own, other) {
  const weight = WEIGHT[/** @type {keyof typeof WEIGHT} */ (own)] ?? 5;
  return other === 'crit' ? weight < 3 : other === 'warn' && weight < 1;
}
