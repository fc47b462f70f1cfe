// Fetches the drives of two recordings: of each the part in view, and the whole of its speed with its alarms.

import { lacks } from './compare-layout.js';
import { ranked } from '../core/priority.js';

/** A view that changes is requested once it has rested so long [ms]. */
const REST_MS = 150;
/** While a recording is still being read, it is requested again so often [ms]. */
const GROWS_MS = 1500;
const OVERVIEW_MS = 5000;
/** A failed request is repeated so soon [ms]. */
const FAILED_MS = 3000;
const BUCKETS = 500;
const OVERVIEW_BUCKETS = 300;

/**
 * @typedef {import('../home/drive-layout.js').Answer} Answer
 * @typedef {import('../home/drive-layout.js').View} View
 */

/** Of one side. */
export class SideFeed {
  /** The part in view. @type {Answer | null} */
  answer = null;
  /** The whole recording. @type {Answer | null} */
  overview = null;
  #token = '';
  #got = '';
  #wanted = '';
  #wanted_ms = 0;
  #asked_ms = -Infinity;
  #overview_ms = -Infinity;
  #failed_ms = -Infinity;
  #isAsking = false;

  /** @param {import('../core/store.js').Store} store @param {() => void} onNew */
  constructor(store, onNew) {
    this.store = store;
    this.onNew = onNew;
  }

  get isWhole() {
    return this.overview !== null && !this.overview.is_sketch && this.overview.known_s >= this.overview.length_s - 0.5;
  }

  /**
   * Called again and again: requests what is due, one thing at a time.
   * @param {string} token
   * @param {string[]} signals
   * @param {View} view on its own time line
   * @param {number} length_s
   */
  look(token, signals, [from_s, to_s], length_s) {
    const now_ms = this.store.now();
    if (token !== this.#token) {
      this.#token = token;
      this.answer = this.overview = null;
      this.#got = '';
      this.#overview_ms = -Infinity;
    }
    const margin_s = (to_s - from_s) / 4;
    const part = { from_s: Math.max(0, from_s - margin_s), to_s: Math.min(length_s, to_s + margin_s) };
    const key = `${signals} ${part.from_s.toFixed(1)} ${part.to_s.toFixed(1)}`;
    if (key !== this.#wanted) [this.#wanted, this.#wanted_ms] = [key, now_ms];
    if (this.#isAsking || document.hidden || now_ms - this.#failed_ms < FAILED_MS) return;
    const isRested = now_ms - this.#wanted_ms >= REST_MS || this.answer === null;
    const isGrowing = this.answer !== null && (this.answer.is_sketch || this.answer.known_s < this.answer.length_s - 0.5);
    if (part.to_s > part.from_s && ((key !== this.#got && isRested) || (isGrowing && now_ms - this.#asked_ms >= GROWS_MS))) {
      this.#asked_ms = now_ms;
      void this.#fetch({ signals: signals.join(), buckets: BUCKETS, ...part }, (answer) => {
        this.answer = answer;
        this.#got = key;
      });
    } else if (!this.isWhole && now_ms - this.#overview_ms >= OVERVIEW_MS) {
      this.#overview_ms = now_ms;
      void this.#fetch({ signals: 'speed', buckets: OVERVIEW_BUCKETS }, (answer) => { this.overview = answer; });
    }
  }

  /** Was a signal never recorded, as far as all of it is known? @param {string} signal */
  lacks(signal) {
    return this.answer !== null && lacks(this.answer, signal);
  }

  /** A part of the speed, once. @param {number} from_s @param {number} to_s @returns {Promise<Answer | null>} */
  async speed(from_s, to_s) {
    return request(this.#token, { signals: 'speed', buckets: BUCKETS, from_s, to_s });
  }

  /** @param {Record<string, string | number>} fields @param {(answer: Answer) => void} take */
  async #fetch(fields, take) {
    const token = this.#token;
    this.#isAsking = true;
    const answer = await request(token, fields);
    this.#isAsking = false;
    if (token !== this.#token) return;
    if (!answer) {
      this.#failed_ms = this.store.now();
      return;
    }
    take(answer);
    this.onNew();
  }
}

/** @param {string} token @param {Record<string, string | number>} fields @returns {Promise<Answer | null>} */
async function request(token, fields) {
  const query = new URLSearchParams(Object.entries(fields).map(([name, value]) => [name, typeof value === 'number' ? String(Number(value.toFixed(2))) : value]));
  query.set('replay', token);
  try {
    const answer = await fetch(`/api/trends/drive?${query}`, { cache: 'no-store' });
    if (!answer.ok) return null;
    const found = await answer.json();
    ranked(found.marks);
    return found;
  } catch {
    return null; // requested again
  }
}
