// What the keys of the queue do: a command for each car, and a sentence where it was refused.

import { WHY } from '../control/viewer.js';
import { openHandover, peopleOf } from './fleet-handover.js';
import { addressOf } from './fleet-rows.js';
import { html, icon, setAttribute, textNodes } from '../core/dom.js';
import { counted } from '../core/format.js';
import { isMaybe, laterWords } from '../core/outcome.js';

/**
 * @typedef {import('./fleet-layout.js').Act} Act
 * @typedef {import('./fleet-layout.js').Item} Item
 */

const STAYS_MS = 8000;
/** Of many commands so many go at once, the others one by one: a server takes 40 a second [ms]. */
const AT_ONCE = 40;
const PACE_MS = 30;
const COMMANDS = /** @type {const} */ ({
  take: ['take_item', {}], over: ['take_item', { over: true }], release: ['release_item', {}], withdraw: ['withdraw_item', {}],
  accept: ['answer_item', { accept: true }], decline: ['answer_item', { accept: false }],
});

export class FleetActs {
  /** Items of floods that show their cars. @type {Set<string>} */
  unfolded = new Set();
  /** Lost cars whose sound was silenced here, until data comes again. @type {Set<string>} */
  hushed = new Set();
  /** What is shown has changed here. */
  onChange = () => {};

  /** @param {import('./fleet-store.js').FleetStore} store @param {HTMLElement} snacks */
  constructor(store, snacks) {
    this.store = store;
    this.snacks = snacks;
    store.on('became', ({ kind, became, reason, cut }) => {
      const { text, title } = laterWords(kind, became, reason, cut);
      this.say(text, title);
    });
  }

  /** @param {Act} act @param {Item} item @param {HTMLElement} key */
  async do(act, item, key) {
    if (act === 'show') return this.unfold(item.key);
    if (act === 'open') return this.open(item.name);
    if (act === 'hush') return this.hush(item.cars);
    if (this.store.isViewer) return this.say(WHY, 'A viewer can only watch');
    if (act === 'off' || act === 'on') return this.turn(act, item.name, key);
    if (act === 'hand') {
      openHandover(item.name, peopleOf(this.store.cars, item.cars, this.store.page), (to) => void this.#handOver(to.page, item, key));
      return undefined;
    }
    const [kind, fields] = COMMANDS[act];
    const isDone = await this.#send(kind, fields, item, key);
    // The person who has it works on it: its own tabs are opened, and nothing is armed by that.
    if (isDone && item.cars.length === 1 && (act === 'take' || act === 'over' || act === 'accept')) this.open(item.name);
    return undefined;
  }

  /** Only who has it can ask another: what nobody has is assigned to this page first, and stays so until they accept. @param {string} to @param {Item} item @param {HTMLElement} key */
  async #handOver(to, item, key) {
    if (item.isUnassigned && !(await this.#send('take_item', {}, item, key))) return;
    await this.#send('offer_item', { to }, item, key);
  }

  /**
   * An operator marks a silent car as off on purpose, or takes the mark back.
   * @param {'off' | 'on'} act
   * @param {string} name
   * @param {HTMLElement} key
   */
  async turn(act, name, key) {
    setAttribute(key, 'data-busy', true);
    try {
      const answer = await fetch(`/api/off/${encodeURIComponent(name)}`, { method: act === 'off' ? 'PUT' : 'DELETE', cache: 'no-store', headers: { 'x-catgraph-name': this.store.self.name.replace(/[^ -~]/g, '?') } });
      if (!answer.ok) throw new Error((await answer.json()).detail);
      if (act === 'off') this.say(`${name} is not shown as lost until data of it comes again. Not off takes that back.`, 'Off on purpose');
    } catch (error) {
      this.say(error instanceof Error && !(error instanceof TypeError) ? error.message : 'The server does not answer.', 'Not done');
    }
    setAttribute(key, 'data-busy', null);
    this.onChange();
  }

  /** A planned stop ends as by the key on the car's own page: its alarms sound again. @param {string} vehicle @param {HTMLElement} key */
  async endStop(vehicle, key) {
    if (this.store.isViewer) return this.say(WHY, 'A viewer can only watch');
    setAttribute(key, 'data-busy', true);
    const answer = await this.store.ask('end_planned_stop', { vehicle });
    setAttribute(key, 'data-busy', null);
    if (!answer.ok) this.say(`${vehicle}: ${answer.reason ?? 'The server did not say why.'}`, 'Not ended');
    return undefined;
  }

  /** @param {string} name */
  open(name) {
    location.assign(addressOf(name));
  }

  /** @param {string[]} names */
  hush(names) {
    for (const name of names) this.hushed.add(name);
    this.onChange();
  }

  /** @param {string} key */
  unfold(key) {
    if (!this.unfolded.delete(key)) this.unfolded.add(key);
    this.onChange();
  }

  /**
   * One command for each car; of many, those that were refused are counted.
   * @param {string} kind
   * @param {Record<string, unknown>} fields
   * @param {Item} item
   * @param {HTMLElement} key
   */
  async #send(kind, fields, item, key) {
    setAttribute(key, 'data-busy', true);
    const refused = [];
    const wanted = kind === 'take_item' && !fields['over'] && item.cars.length > 1 ? this.#free(item.cars) : item.cars;
    for (const [i, vehicle] of wanted.entries()) {
      if (i > AT_ONCE) await new Promise((resolve) => { setTimeout(resolve, PACE_MS); });
      const answer = await this.store.ask(kind, { vehicle, ...fields });
      if (!answer.ok) refused.push(`${vehicle}: ${answer.reason ?? 'The server did not say why.'}`);
    }
    setAttribute(key, 'data-busy', null);
    this.onChange();
    if (refused.length) this.say(refused.slice(0, 2).join(' '), refused.length > 1 ? `${counted(refused.length, 'car')} refused` : 'Not done');
    return refused.length === 0;
  }

  /** Those that nobody has. @param {string[]} names */
  #free(names) {
    const cars = (this.store.cars?.cars ?? []).filter(({ name }) => names.includes(name));
    return cars.filter(({ summary }) => summary && !summary.attention?.assigned).map(({ name }) => name);
  }

  /** @param {string} sentence @param {string} given the title @param {() => void} [onClosed] it was closed by hand */
  say(sentence, given, onClosed) {
    const title = isMaybe(sentence) ? 'Not known' : given; // the caller takes it for refused
    const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close' }, icon('close'));
    const note = html('div', { class: 'snack note', role: 'status' }, html('div', { class: 'side' }, icon('info')),
      html('div', { class: 'tx' }, html('b', {}, ...textNodes(title)), html('span', {}, ...textNodes(sentence))), close);
    close.addEventListener('click', () => {
      note.remove();
      onClosed?.();
    });
    setTimeout(() => note.remove(), STAYS_MS);
    this.snacks.replaceChildren(note);
  }
}
