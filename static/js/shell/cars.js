// Which car this page shows: its name and the others' alarms on the chip of the top bar, its list, and the way to another car.

import { alone, badgeOf, rowsOf, shortNames } from './cars-layout.js';
import { chipOf } from '../control/control-layout.js';
import { openDuty } from '../control/duty.js';
import { counted } from '../core/format.js';
import { field, listen, setAttribute, setIcon, setText, show } from '../core/dom.js';
import { styled } from '../core/style-sheet.js';

/** The car that this phone opens where the address names none; early.js reads it. */
const KEPT = 'catgraph.car';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('./cars-layout.js').CarRow} CarRow
 */

export class Cars {
  /** @type {Map<string, string>} */
  #short = new Map();
  #named = '';

  /** @param {Store} store @param {(sentence: string, title?: string) => void} say */
  constructor(store, say) {
    this.store = store;
    this.say = say;
    /** Opens who is in control. */
    this.openControl = () => {};
    /** The list is opened. */
    this.onListed = () => {};
  }

  /** Every car, the one that needs a person most first. @returns {CarRow[]} */
  rows() {
    const { store } = this;
    return store.cars ? rowsOf(store.cars, store.carsLag_s, store.page) : rowsOf(alone(store.heeded), store.isSilent ? Infinity : store.lag_s, store.page);
  }

  /** The name of the car in at most 8 characters, as no other has it. @param {string} name */
  shortOf(name) {
    const { vehicles } = this.store;
    const key = vehicles.join();
    if (key !== this.#named) {
      this.#named = key;
      this.#short = shortNames(vehicles);
    }
    return this.#short.get(name) ?? name.slice(0, 8);
  }

  /** Shows another car, and remembers it as this phone's. @param {string} name */
  open(name) {
    if (name === this.store.vehicle) return;
    const url = new URL(location.href);
    url.searchParams.set('vehicle', name);
    for (const key of ['replay', 't']) url.searchParams.delete(key);
    history.replaceState(history.state, '', url);
    document.documentElement.dataset['vehicle'] = name;
    document.querySelector('#undrawn-reload')?.setAttribute('href', `/?vehicle=${encodeURIComponent(name)}`);
    for (const sheet of /** @type {NodeListOf<HTMLDialogElement>} */ (document.querySelectorAll('dialog[open]'))) sheet.close();
    for (const note of document.querySelectorAll('.snack.note, .snack.prompt')) note.remove();
    try {
      localStorage.setItem(KEPT, name);
    } catch {
      // no storage: the server's first car is opened next time
    }
    this.store.show(name);
  }

  openList() {
    this.onListed();
    Promise.all([import('./cars-sheet.js'), styled('cars')]).then(([{ openCars }]) => openCars(this.store, { rows: () => this.rows(), open: (name) => this.open(name), openControl: () => this.openControl(), openDuty: () => void openDuty(this.store, this.say) }))
      .catch(() => this.say('The list of cars could not be loaded.', 'Not opened'));
  }
}

/** A chip, in the top bar of the monitor or of the connect screen. @param {HTMLElement} root @param {Cars} cars */
export function mountChip(root, cars) {
  const { store } = cars;
  const [chip, name, operator, badge, count, more] = ['who', 'car-name', 'who-name', 'car-badge', 'car-count', 'car-more'].map((one) => field(root, one));
  if (!chip || !name || !operator || !badge || !count || !more) throw new Error('The template lacks the chip');
  const mark = /** @type {Element} */ (badge.querySelector('.i'));

  function draw() {
    const { vehicle } = store;
    const short = cars.shortOf(vehicle);
    setText(name, short || '–');
    const others = store.cars ? badgeOf(cars.rows(), vehicle) : null;
    show(badge, others !== null);
    show(more, others === null);
    setAttribute(badge, 'data-kind', others?.kind ?? null);
    setAttribute(badge, 'data-filled', others?.isFilled);
    if (others) {
      setIcon(mark, others.icon);
      setText(count, String(others.count));
    }
    const { text, label, is } = chipOf(store.control, store.page, store.isSilent, store.duty);
    const needing = others ? `. ${counted(others.count, 'other car needs', 'other cars need')} a person` : '';
    setText(operator, text);
    setAttribute(chip, 'data-is', is);
    setAttribute(chip, 'data-duty', Boolean(store.duty?.me));
    setAttribute(chip, 'aria-label', `${short} ${text}${others ? ` ${others.count}` : ''}: the car ${vehicle}. ${label}${needing}`); // begins with what is seen
  }

  draw();
  const stops = [store.on('draw', draw), store.on('cars', draw), store.on('duty', draw), listen(chip, 'click', () => cars.openList())];
  return () => stops.forEach((stop) => stop());
}
