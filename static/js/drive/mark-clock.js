// What time of day a tap was, by the server's clock: this phone's own may be an hour off, and the server may be away.

import { ServerClock } from '../core/clock.js';

const KEPT = 'catgraph.clock-ahead';
/** The wall clock went on by so much more than the page's own [ms]: the phone slept meanwhile, and only the wall clock counted it. */
const SLEPT_MS = 500;
/** What is remembered for another visit is written again when it changed by so much [ms]. */
const CHANGED_MS = 50;

/**
 * @typedef {'measured' | 'remembered' | 'unknown'} Source of a time: data came from the server to this page, to an earlier visit of it, or never
 * @typedef {{at_ms: number, ahead_ms: number, source: Source}} Moment at_ms: by the server's clock; ahead_ms: this phone's clock − the server's
 */

export class MarkClock {
  #server = new ServerClock();
  /** The page's monotonic clock − the server's. @type {number | null} */
  #lead_ms = null;
  /** @type {number | null} */
  #ahead_ms;
  #noted = { now_ms: 0, wall_ms: 0 };
  #storage;

  /** @param {{getItem: (key: string) => string | null, setItem: (key: string, value: string) => void} | null} storage where it is remembered for another visit */
  constructor(storage) {
    this.#storage = storage;
    this.#ahead_ms = recall(storage);
  }

  /** A new connection: its first message starts afresh; until then the old measure holds. */
  reset() {
    this.#server.forget();
  }

  /**
   * A message of the server came.
   * @param {number} time_ms when it was sent, by the server's clock
   * @param {number} now_ms by the page's monotonic clock
   * @param {number} wall_ms by this phone's clock
   */
  note(time_ms, now_ms, wall_ms) {
    const delay_ms = this.#server.note(time_ms, now_ms);
    this.#lead_ms = now_ms - time_ms - delay_ms;
    this.#noted = { now_ms, wall_ms };
    const ahead_ms = wall_ms - (now_ms - this.#lead_ms);
    if (this.#ahead_ms === null || Math.abs(ahead_ms - this.#ahead_ms) > CHANGED_MS) {
      this.#ahead_ms = ahead_ms;
      keep(this.#storage, ahead_ms);
    }
  }

  /** @param {number} now_ms @param {number} wall_ms @returns {Moment} */
  at(now_ms, wall_ms) {
    if (this.#lead_ms !== null) {
      const slept_ms = wall_ms - this.#noted.wall_ms - (now_ms - this.#noted.now_ms);
      const at_ms = slept_ms > SLEPT_MS ? wall_ms - (this.#ahead_ms ?? 0) : now_ms - this.#lead_ms;
      return { at_ms: Math.round(at_ms), ahead_ms: Math.round(wall_ms - at_ms), source: 'measured' };
    }
    if (this.#ahead_ms !== null) return { at_ms: Math.round(wall_ms - this.#ahead_ms), ahead_ms: Math.round(this.#ahead_ms), source: 'remembered' };
    return { at_ms: Math.round(wall_ms), ahead_ms: 0, source: 'unknown' };
  }

  /** Whether data came from the server to this page: a time from before that can be corrected by `at`. */
  get isMeasured() {
    return this.#lead_ms !== null;
  }
}

/** @param {{getItem: (key: string) => string | null} | null} storage */
function recall(storage) {
  try {
    const kept = Number(storage?.getItem(KEPT) ?? NaN);
    return Number.isFinite(kept) ? kept : null;
  } catch {
    return null;
  }
}

/** @param {{setItem: (key: string, value: string) => void} | null} storage @param {number} ahead_ms */
function keep(storage, ahead_ms) {
  try {
    storage?.setItem(KEPT, String(Math.round(ahead_ms)));
  } catch {
    // no storage: another visit measures anew
  }
}
