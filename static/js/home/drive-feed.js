// Fetches the drive of the chosen signals from the server: the part in view with a margin, and the whole of the first one.

import { ranked } from '../core/priority.js';

/** A view that changes is requested once it has rested so long [ms]. */
const REST_MS = 150;
/** While the drive goes on, a view is requested again when it has moved by a part of its width, but not more often than this [ms]. */
const LEAST_MS = 1000;
const MOST_MS = 10_000;
const PART = 1 / 120;
const OVERVIEW_MS = 15_000;
/** So long after an answer is due, what is shown is not live [ms]. */
const LATE_MS = 2000;
const BUCKETS = 500;
const OVERVIEW_BUCKETS = 200;

/**
 * @typedef {import('./drive-layout.js').Answer} Answer
 * @typedef {import('./drive-layout.js').View} View
 */

export class DriveFeed {
  /** @type {Answer | null} */
  answer = null;
  /** The whole drive of the first signal. @type {Answer | null} */
  overview = null;
  /** When the newest answer came. */
  answered_ms = -Infinity;
  /** @type {string[]} */
  #signals = [];
  /** @type {View} */
  #view = [0, 60];
  #context = '';
  #wanted_ms = -Infinity;
  #isWanted = true;
  #requested_ms = -Infinity;
  #overview_ms = -Infinity;
  #isAsking = false;

  /** An answer came that is not drawn yet: it is drawn with the rest, for a picture of its own costs as much as theirs. */
  isNew = false;

  /** @param {import('../core/store.js').Store} store */
  constructor(store) {
    this.store = store;
  }

  /** The end of what the drive has by now [s]; it moves on while the server does not answer. */
  get end_s() {
    if (!this.answer) return 60;
    const late_ms = this.store.now() - this.answered_ms;
    return this.answer.length_s + (this.isLate && !this.store.replaying ? late_ms / 1000 : 0);
  }

  /** The server has not answered for some seconds. */
  get isLate() {
    return this.store.now() - this.answered_ms > this.#every_ms + LATE_MS;
  }

  get #every_ms() {
    return Math.min(MOST_MS, Math.max(LEAST_MS, (this.#view[1] - this.#view[0]) * PART * 1000));
  }

  /** What is in view now. @param {string[]} signals @param {View} view */
  want(signals, view) {
    const isSame = signals.join() === this.#signals.join();
    if (isSame && view[0] === this.#view[0] && view[1] === this.#view[1]) return;
    if (!isSame) {
      this.#overview_ms = -Infinity;
      this.#requested_ms = -Infinity;
    }
    this.#signals = [...signals];
    this.#view = [...view];
    this.#isWanted = true;
    this.#wanted_ms = this.store.now();
  }

  /** Called with each state: requests what is due. */
  look() {
    const { store } = this;
    const { frame } = store;
    if (!frame || this.#isAsking || document.hidden || !this.#signals.length) return;
    const context = `${frame.server.boot} ${frame.vehicle} ${frame.replay?.token}`;
    if (context !== this.#context) {
      this.#context = context;
      this.answer = this.overview = null;
      this.#requested_ms = this.#overview_ms = -Infinity;
    }
    const now_ms = store.now();
    const isGrowing = !store.replaying || !this.answer || this.answer.is_sketch || this.answer.known_s < this.answer.length_s;
    const isDue = isGrowing && now_ms - this.#requested_ms >= this.#every_ms;
    const isRested = this.#isWanted && now_ms - this.#wanted_ms >= REST_MS && now_ms - this.#requested_ms >= 2 * REST_MS;
    if (isDue || isRested) void this.#request(context);
    else if (this.answer && now_ms - this.#overview_ms >= (isGrowing ? OVERVIEW_MS : Infinity)) void this.#requestOverview(context);
  }

  /** @param {string} context */
  async #request(context) {
    this.#requested_ms = this.store.now();
    this.#isWanted = false;
    const [from_s, to_s] = this.#view;
    const margin_s = (to_s - from_s) / 4;
    // Before the first answer nobody knows how long the drive is: the whole of it tells.
    /** @type {Record<string, number>} */
    const part = this.answer ? { from_s: Math.max(0, from_s - margin_s), to_s: Math.max(0, to_s) + margin_s } : {};
    const found = await this.#fetch({ signals: this.#signals.join(), buckets: BUCKETS, ...part });
    if (!found || context !== this.#context) return;
    const isFirst = this.answer === null;
    this.answer = found;
    this.answered_ms = this.store.now();
    if (isFirst) this.#isWanted = true;
    this.isNew = true;
  }

  /** @param {string} context */
  async #requestOverview(context) {
    this.#overview_ms = this.store.now();
    const found = await this.#fetch({ signals: this.#signals[0] ?? 'speed', buckets: OVERVIEW_BUCKETS });
    if (!found || context !== this.#context) return;
    this.overview = found;
    this.isNew = true;
  }

  /** @param {Record<string, string | number>} fields @returns {Promise<Answer | null>} */
  async #fetch(fields) {
    const { frame } = this.store;
    const query = new URLSearchParams(Object.entries(fields).map(([name, value]) => [name, typeof value === 'number' ? String(Number(value.toFixed(2))) : value]));
    if (frame?.vehicle) query.set('vehicle', frame.vehicle);
    if (frame?.replay) query.set('replay', frame.replay.token);
    this.#isAsking = true;
    try {
      const answer = await fetch(`/api/trends/drive?${query}`, { cache: 'no-store' });
      if (!answer.ok) return null;
      const found = await answer.json();
      ranked(found.marks);
      return found;
    } catch {
      return null; // requested again; until then the chart shows that it is not live
    } finally {
      this.#isAsking = false;
    }
  }
}
