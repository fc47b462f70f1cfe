// The marks of this phone: placed at once, kept, changed, delivered. What is drawn of them listens to `onChange`.

import { keptHere } from '../control/device-name.js';
import { Delivery } from './mark-delivery.js';
import { MarkClock } from './mark-clock.js';
import { MarkKeep } from './mark-keep.js';
import { alone, Spoken } from './mark-locks.js';
import { bereft, corrected, joined, newMark, orphaned, outdated, stepOf, waitingOf } from './mark-model.js';
import { isThere, serverOf } from './mark-server.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('./mark-model.js').Mark} Mark
 * @typedef {import('./mark-model.js').Part} Part
 * @typedef {(sentence: string, title?: string, way?: import('../shell/notice.js').Way) => void} Say
 */

/** Marks that are looked at so often for delivery [ms]. */
const LOOKS_EVERY_MS = 1000;
/** What other pages of this browser keep is read so often: they may have been closed [ms]. */
const RECALLS_EVERY_MS = 30_000;
/** A storage that hangs holds nothing up for longer [ms]. */
const WRITES_MS = 2000;
const MEMORY = 'This browser stores nothing. A mark is lost if the page is closed before the server has it.';
const FULL = 'The storage of this device is full. The mark is stored; its voice and photo are lost if the page is closed before the server has them.';

export class Marks {
  /** @type {Map<string, Mark>} */
  #marks = new Map();
  /** Writes of one mark follow each other. @type {Map<string, Promise<void>>} */
  #writing = new Map();
  /** @type {Set<() => void>} */
  #listeners = new Set();
  #reported = '';
  #looked_ms = -Infinity;
  #recalled_ms = -Infinity;
  #spoken = new Spoken();
  /** Those that were found or put in the storage. @type {Set<string>} */
  #kept = new Set();
  /** Those whose last change was stored, with voice and photo. @type {Set<string>} */
  #whole = new Set();
  /** Those that are none any more. @type {Set<string>} */
  #dropped = new Set();
  /** Nothing of a mark would outlast the page. */
  isDurable = true;
  /** Resolves once those of earlier visits are there. @type {Promise<void>} */
  ready;

  /** @param {Store} store @param {Say} say @param {MarkKeep} [keep] */
  constructor(store, say, keep = new MarkKeep(keptHere())) {
    this.store = store;
    this.say = say;
    this.keep = keep;
    this.clock = new MarkClock(keptHere());
    this.delivery = new Delivery(
      {
        all: () => this.#marks.values(),
        read: (id) => this.#read(id),
        alone,
        change: (id, change) => this.change(id, change),
        onTakenBack: (reason) => this.say(reason ? `The mark was not taken back. ${reason}` : 'The mark was taken back.', reason ? 'Refused' : undefined),
      },
      serverOf(store),
      () => store.now(),
    );
    this.stops = [
      store.on('beat', () => this.#beat()),
      store.on('open', () => this.clock.reset()),
      store.on('tick', () => this.#look()),
    ];
    this.ready = this.#recall();
  }

  stop() {
    for (const stop of this.stops) stop();
  }

  /** @param {() => void} listener */
  onChange(listener) {
    this.#listeners.add(listener);
    return () => void this.#listeners.delete(listener);
  }

  /** All of the car that is shown, newest first; without those taken back. */
  get all() {
    const own = [...this.#marks.values()].filter(({ vehicle, isRemoved }) => vehicle === this.store.vehicle && !isRemoved);
    return own.sort((a, b) => b.wall_ms - a.wall_ms);
  }

  /** Those that the server does not have whole. */
  get waiting() {
    return waitingOf(this.#marks.values(), this.store.vehicle).filter(({ isRemoved }) => !isRemoved);
  }

  /** @param {string} id */
  get(id) {
    return this.#marks.get(id) ?? null;
  }

  /** It is on the disk of this device as it is shown. @param {string} id */
  isKept(id) {
    return this.#whole.has(id);
  }

  /** The server can take a mark now. */
  get isServerThere() {
    return isThere(this.store);
  }

  /** Now, by the server's clock as far as it is known [ms]. */
  get now_ms() {
    return this.clock.at(this.store.now(), Date.now()).at_ms;
  }

  /** Marks a moment. @param {number} [ago_ms] it was so long ago: a finger that holds began then @returns {Mark} */
  place(ago_ms = 0) {
    const wall_ms = Date.now() - ago_ms;
    const mark = newMark(newId(), this.store.vehicle, this.clock.at(this.store.now() - ago_ms, wall_ms), wall_ms);
    this.#marks.set(mark.id, mark);
    void this.#write(mark.id, (now) => now, mark);
    return mark;
  }

  /**
   * Change a mark, keep it and deliver it.
   * @param {string} id
   * @param {(mark: Mark) => Mark | null} change null drops it
   */
  async change(id, change) {
    const mark = this.#marks.get(id);
    if (!mark) return;
    const changed = change(mark);
    this.#set(id, changed);
    await soon(this.#write(id, change, mark));
  }

  /** What a person changed of it. @param {string} id @param {Partial<Pick<Mark, 'shift_s' | 'category' | 'words'>>} changes */
  edit(id, changes) {
    return this.change(id, (mark) => {
      const isSame = Object.entries(changes).every(([name, value]) => mark[/** @type {'words'} */ (name)] === value);
      return isSame ? mark : { ...mark, ...changes, version: mark.version + 1 };
    });
  }

  /** Voice or photo, as far as it has come. @param {string} id @param {'voice' | 'photo'} name @param {Part} part */
  attach(id, name, part) {
    if (part.isOpen) this.#spoken.begin(id);
    const made = newId();
    return this.change(id, (mark) => ({ ...mark, [name]: { ...part, made } }));
  }

  /** Take it back, here or, once it was sent, at the server. @param {string} id */
  remove(id) {
    const mark = this.#marks.get(id);
    if (mark && !mark.isSent && mark.stored === 0) this.say('The mark was taken back.');
    else if (!this.isServerThere) this.say('The mark is taken back once the server answers.');
    return this.change(id, (mark) => (stepOf({ ...mark, isRemoved: true }) === 'drop' ? null : { ...mark, isRemoved: true }));
  }

  /** @param {string} id @param {Mark | null} mark */
  #set(id, mark) {
    if (mark) this.#marks.set(id, mark);
    else this.#marks.delete(id);
    if (mark) this.#dropped.delete(id);
    else this.#dropped.add(id);
  }

  /** What earlier visits and other pages left. */
  async #recall() {
    this.#recalled_ms = this.store.now();
    const kept = await this.keep.all().catch(() => []);
    const isSpoken = await this.#spoken.all();
    for (const mark of kept.filter(({ id }) => !this.#writing.has(id) && !this.#dropped.has(id))) {
      this.#kept.add(mark.id);
      const own = this.#marks.get(mark.id);
      this.#marks.set(mark.id, own ? joined(own, mark) : bereft(mark));
      if (mark.voice?.isOpen && (isSpoken ? !isSpoken(mark.id) : !own)) void this.change(mark.id, (now) => bereft(orphaned(now)));
    }
    const found = new Set(kept.map(({ id }) => id));
    for (const id of [...this.#marks.keys()]) if (!found.has(id)) void this.#read(id);
    for (const { id } of outdated(this.#marks.values(), Date.now())) void this.change(id, () => null);
    this.#notify();
    void this.delivery.look();
  }

  /** A mark as it is kept by now: another page may have changed or dropped it. @param {string} id */
  async #read(id) {
    await soon(this.#writing.get(id));
    const [own, kept] = [this.get(id), await soon(this.keep.get(id).catch(() => undefined))];
    if (own && kept !== undefined && !this.#writing.has(id)) {
      if (kept) this.#marks.set(id, joined(kept, own));
      else if (this.#kept.has(id)) this.#set(id, null);
    }
    return this.get(id);
  }

  /** Keep what is changed of it. @param {string} id @param {(mark: Mark) => Mark | null} change @param {Mark} before @returns {Promise<void>} */
  #write(id, change, before) {
    this.#whole.delete(id);
    this.#notify();
    const written = (this.#writing.get(id) ?? Promise.resolve()).then(async () => {
      const { mark, kept } = await this.keep.change(id, change, this.#marks.get(id) ?? before, this.#kept.has(id));
      if (this.#writing.get(id) === written) this.#set(id, mark); // else it is being changed again
      if (!this.get(id)?.voice?.isOpen) this.#spoken.end(id);
      if (!mark) return;
      if (kept !== 'memory') this.#kept.add(id);
      if (kept === 'whole') this.#whole.add(id);
      this.isDurable = kept !== 'memory';
      if (stepOf(mark) === null || kept === 'whole') return;
      const trouble = kept === 'memory' ? MEMORY : FULL;
      if (trouble !== this.#reported) this.say(trouble, 'Stored in part');
      this.#reported = trouble;
    }).catch((error) => console.info('A mark could not be kept:', error));
    this.#writing.set(id, written);
    void written.then(() => {
      if (this.#writing.get(id) === written) this.#writing.delete(id);
      this.#notify();
      void this.delivery.look();
    });
    return written;
  }

  #notify() {
    for (const listener of this.#listeners) quietly(listener);
  }

  #beat() {
    quietly(() => {
      const { frame } = this.store;
      if (!frame) return;
      const wasMeasured = this.clock.isMeasured;
      this.clock.note(frame.server.time_ms, this.store.now(), Date.now());
      if (!wasMeasured) this.#correct();
    });
  }

  /** Those that were pressed before anything came from a server get its time. */
  #correct() {
    const { ahead_ms } = this.clock.at(this.store.now(), Date.now());
    for (const mark of [...this.#marks.values()]) if (mark.clock === 'unknown' && mark.stored === 0) void this.change(mark.id, (now) => corrected(now, ahead_ms));
    void this.delivery.hurry();
  }

  #look() {
    const now_ms = this.store.now();
    if (now_ms - this.#looked_ms < LOOKS_EVERY_MS) return;
    this.#looked_ms = now_ms;
    if (now_ms - this.#recalled_ms >= RECALLS_EVERY_MS) void this.#recall();
    void this.delivery.look();
  }
}

/** What draws a mark must never end what shows the car. @param {() => void} act */
export function quietly(act) {
  try {
    act();
  } catch (error) {
    console.info('Marks:', error);
  }
}

function newId() {
  return [...crypto.getRandomValues(new Uint8Array(10))].map((byte) => byte.toString(16).padStart(2, '0')).join('');
}

/** What a storage that hangs gives is not waited for. @template T @param {Promise<T> | undefined} wanted @returns {Promise<T | undefined>} */
function soon(wanted) {
  return Promise.race([wanted, new Promise((/** @type {(nothing: undefined) => void} */ resolve) => { setTimeout(() => resolve(undefined), WRITES_MS); })]);
}
