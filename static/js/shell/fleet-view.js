// Draws the page of all cars from what its store knows: one view of it all is made, and each part writes what has changed.

import { drawChain } from './chain.js';
import { openDuty } from '../control/duty.js';
import { dutyEndedNotice } from '../control/duty-notices.js';
import { dutyWords } from '../control/duty-layout.js';
import { grouped, headOf, isLost, itemsOf, silenceOf } from './fleet-layout.js';
import { LostPanel, lostChain } from './fleet-lost.js';
import { FleetMap } from './fleet-map.js';
import { Queue, arrange } from './fleet-queue.js';
import { Places, Rows } from './fleet-rows.js';
import { MANY, carRows, foldedRows, lineOf, lostLine, placesOf, rowsAPage } from './fleet-rows-layout.js';
import { field, html, listen, need, setAttribute, setIcon, setText, setSentence, show } from '../core/dom.js';
import { age, timeOfDay } from '../core/format.js';

/**
 * @typedef {import('./fleet-layout.js').Item} Item
 * @typedef {import('./fleet-rows-layout.js').Row} Row
 */

const NONE = 'No car is listed yet. A car is listed here once this server is started with it (--vehicle NAME=ws://ADDRESS), or once its agent has connected to the broker.';
/** Two columns and pages; else everything is in one column that scrolls. */
const WIDE = '(width >= 47.5em) and (height >= 35em)';
const DESKTOP = '(width >= 75em)';

export class FleetView {
  /** Items of one car each. @type {Item[]} */
  items = [];
  #wide = matchMedia(WIDE);
  #desktop = matchMedia(DESKTOP);

  /**
   * @param {HTMLElement} root
   * @param {import('./fleet-store.js').FleetStore} store
   * @param {import('./fleet-acts.js').FleetActs} acts
   * @param {import('./press.js').Press} press
   */
  constructor(root, store, acts, press) {
    this.root = root;
    this.store = store;
    this.acts = acts;
    this.press = press;
    const one = (/** @type {string} */ name) => field(root, name);
    this.bar = { chain: one('small-chain'), state: one('link-state'), age: one('link-age'), unit: one('link-unit'), count: one('count'), of: one('count-unit'), clock: one('clock') };
    this.line = { strip: one('strip'), text: one('strip-text'), end: one('strip-end'), more: one('strip-more') };
    this.floor = one('floor');
    this.over = one('over-words');
    this.none = one('none');
    this.log = { root: one('log'), list: one('events') };
    this.queue = new Queue(root, (act, item, key) => void acts.do(act, item, key), () => this.#wide.matches);
    this.rows = new Rows(root, (row) => (row.cars.length === 1 ? acts.open(row.name) : acts.unfold(row.key)), (name, key) => void acts.endStop(name, key));
    this.places = new Places(root);
    this.map = new FleetMap(root, (name) => acts.open(name));
    this.lost = new LostPanel(root, (name, key) => void acts.turn('off', name, key));
    this.title = document.title;
    this.icon = /** @type {HTMLLinkElement} */ (need(document, 'link[rel="icon"]'));
    this.plain = this.icon.getAttribute('href') ?? '';
    acts.onChange = () => store.painter.draw();
    this.me = one('me');
    /** @type {import('../control/duty.js').Say} */
    const say = (sentence, title = 'On duty', way = undefined) => acts.say(sentence, title, way?.onClosed);
    this.#drawMe();
    listen(one('duty'), 'click', () => void openDuty(store, say));
    const ended = dutyEndedNotice(store, say);
    store.on('duty', () => {
      this.#drawMe();
      ended();
    });
    store.on('draw', ended);
    for (const name of ['queue', 'cars', 'map']) listen(one(`show-${name}`), 'click', () => this.#turn(name));
    this.#turn('queue');
  }

  /** Who is on duty at this device. */
  #drawMe() {
    const { duty, self } = this.store;
    const me = duty?.me ? `${duty.me.name}, ${duty.me.title}` : `You, ${self.name}`; // the name may be cut, "you" may not
    setText(this.me, me);
    setAttribute(field(this.root, 'duty'), 'aria-label', `${me}. ${dutyWords(duty)}`);
  }

  /** What of it a phone shows. @param {string} name */
  #turn(name) {
    setAttribute(this.root, 'data-show', name);
    for (const one of ['queue', 'cars', 'map']) setAttribute(field(this.root, `show-${one}`), 'aria-pressed', String(one === name));
    this.floor.scrollTop = 0;
    if (this.store.cars) this.store.painter.picture(() => this.store.painter.draw());
  }

  /** What the pure functions are given. @returns {import('./fleet-layout.js').Seen} */
  #seen() {
    const { store } = this;
    return {
      cars: store.cars, lag_s: store.lag_s, now_ms: store.serverNow_ms, kept: store.kept, page_ms: store.now(), wall_ms: Date.now(), page: store.page, hushed: this.acts.hushed,
    };
  }

  /** What is known now, without a look at the document: also while the page is hidden. */
  look() {
    const { store } = this;
    const seen = this.#seen();
    const listed = seen.cars?.cars ?? [];
    for (const car of listed) if (!isLost(car, seen.lag_s)) this.acts.hushed.delete(car.name);
    const wanted = listed.filter(({ off }) => !off); // silence of cars that are off on purpose is no sign of a lost link
    const isNothingHeard = wanted.length > 0 && wanted.every((car) => isLost(car, seen.lag_s));
    const lost = store.isSilent ? (store.isAnswering ? 'cars' : 'server') : isNothingHeard ? 'cars' : null;
    const ages = listed.map((car) => silenceOf(car, seen)).filter((one) => one !== null);
    const silence_s = store.isSilent ? store.silence_s : Math.min(...ages); // infinite where no car ever sent data
    const troubles = [...new Set(listed.map((car) => car.trouble).filter(Boolean))];
    const unserved = store.unserved || (troubles.length <= 2 ? troubles.join(' ') : '');
    const heard_ms = store.heard_ms === null || silence_s === Infinity ? null : Date.now() - silence_s * 1000;
    const view = /** @type {import('./fleet-lost.js').LostView} */ ({ lost, silence_s, heard_ms, cars: listed.length, unserved });
    return { seen, view, items: lost ? [] : itemsOf(seen) };
  }

  draw() {
    const { store, acts } = this;
    const { seen, view, items: each } = this.look();
    const { lost } = view;
    this.items = each.filter(({ isOff }) => !isOff);
    const { items, folded, flood } = grouped(this.items, acts.unfolded);
    const rows = carRows(seen, this.items.filter(({ key, name }) => key === name).map(({ name }) => name), lost);
    const shown = items.filter((item) => item.cars.length > 1 || !folded.has(item.key)).length;
    this.#drawState(rows.length, lost, each.length > 0);
    this.#drawBar(view, rows.length);
    this.#drawLine(lost ? lostLine(view.heard_ms, lost === 'server') : store.cars ? lineOf(this.items, items, flood, rows) : null);
    this.lost.draw(view, rows.map(({ name }) => name), store.isViewer ? [] : (seen.cars?.cars ?? []).filter(({ trouble, off }) => trouble && !off).map(({ name }) => name));
    this.queue.draw([...items, ...each.filter(({ isOff }) => isOff)], lost ? '' : headOf(this.items, shown), store.isViewer);
    const folding = foldedRows(rows, folded, acts.unfolded);
    this.rows.draw(folding, this.#aPage(rows.length));
    show(need(this.root, '[data-f="table"]'), rows.length > 0);
    show(this.none, seen.cars !== null && rows.length === 0);
    setSentence(this.none, NONE);
    if (rows.length >= MANY) this.places.draw(placesOf(rows));
    const then = !lost ? '' : view.heard_ms === null ? 'not known' : `then, not now: ${timeOfDay(view.heard_ms)}`;
    const kinds = new Map(rows.map((row) => [row.name, row.isQuiet ? /** @type {const} */ ('') : row.kind]));
    this.map.draw(seen, kinds, new Set([...folded.values()].filter(({ icon }) => icon === 'link-off').flatMap(({ cars }) => cars)), then);
    setSentence(this.over, then);
    this.#drawLog();
    this.press.draw();
  }

  /** @param {number} count @param {string | null} lost @param {boolean} isQueued something is in the queue */
  #drawState(count, lost, isQueued) {
    setAttribute(this.root, 'data-state', lost ? 'lost' : this.store.cars === null ? 'wait' : count ? 'live' : 'none');
    setAttribute(this.root, 'data-many', count >= MANY);
    setAttribute(this.root, 'data-quiet', !lost && !isQueued);
    setAttribute(need(document, '.frame'), 'data-mode', lost ? 'critical' : 'none');
    setText(field(this.root, 'foot-count'), String(count));
    setText(field(this.root, 'foot-queue'), this.items.length ? String(this.items.length) : '');
  }

  /** @param {import('./fleet-lost.js').LostView} view @param {number} count */
  #drawBar(view, count) {
    const { bar, store } = this;
    const isKnown = store.cars !== null || view.lost !== null;
    const state = view.lost ? 'Lost' : isKnown ? 'Live' : 'Waiting';
    setText(bar.state, state);
    setText(bar.age, isKnown ? age(view.lost ? view.silence_s : store.lag_s) : '');
    setText(bar.unit, isKnown ? ' s' : '');
    drawChain(bar.chain, view.lost ? lostChain(view) : { ...lostChain(view), cut: isKnown ? null : 0 });
    setText(bar.count, store.cars ? String(count) : '–');
    setText(bar.of, count === 1 ? 'car' : 'cars');
    setText(bar.clock, timeOfDay(Date.now()));
  }

  /** @param {import('./fleet-rows-layout.js').Line | null} line null: nothing came yet */
  #drawLine(line) {
    const { strip, text, end, more } = this.line;
    setAttribute(strip, 'data-kind', line?.kind || null);
    setAttribute(strip, 'data-known', line !== null && !line.isFilled && line.kind !== '');
    setIcon(need(strip, '.i'), line?.icon ?? 'unknown');
    setSentence(text, line?.text ?? 'Waiting for the server');
    setSentence(end, line?.end ?? '');
    setSentence(more, line?.more ?? '');
    const isAsking = line !== null && line.kind !== '';
    const title = isAsking ? `${this.items.length ? `(${this.items.length}) ` : ''}${line.text} · ${this.title}` : this.title;
    if (document.title !== title && !this.store.painter.drawing.isFailed) document.title = title; // else undrawn.js writes it
    const mark = line?.icon === 'link-off' && !this.items.length ? 'lost' : line?.kind === 'crit' ? 'critical' : line?.kind === 'warn' ? 'warning' : '';
    setAttribute(this.icon, 'href', (mark && this.icon.dataset[mark]) || this.plain);
  }

  /** @param {number} count of cars */
  #aPage(count) {
    if (!this.#wide.matches) return Math.max(1, count * 2); // a phone scrolls
    const { clientHeight } = this.floor;
    const isMany = count >= MANY;
    const queue = this.#desktop.matches ? 0 : need(this.root, '[data-f="queue"]').offsetHeight;
    const [row, below] = this.#desktop.matches ? [isMany ? 28 : 40, isMany ? 270 : 260] : [isMany ? 40 : 44, isMany ? 290 : 250];
    return rowsAPage(count * 2, clientHeight - queue - 80, row, below);
  }

  #drawLog() {
    const { events } = this.store;
    show(this.log.root, events.length > 0);
    const key = `${events[0]?.vehicle} ${events[0]?.n} ${events.length}`;
    if (this.log.list.dataset['key'] === key) return;
    setAttribute(this.log.list, 'data-key', key);
    arrange(this.log.list, events.map(({ vehicle, time_ms, text, by }) => html('li', {}, html('span', { class: 'n' }, timeOfDay(time_ms)), html('b', {}, vehicle), html('span', { title: text }, by && !text.includes(by) ? `${by}: ${text}` : text))));
  }
}
