// The last minute of the signals on Home: kept from the frames, with what this page missed fetched from the server.

import { ABSENT, isAbsent } from '../core/ink.js';
import { Minute, STEP_S } from './trends-layout.js';
import { shownIn } from '../core/units.js';
import { fixed, signed } from '../core/format.js';

/** Least time between two requests for missed values [ms]. */
const REQUEST_EVERY_MS = 2000;

/** @typedef {import('./trends-layout.js').Spec} Spec */

export class Trends {
  minute = new Minute();
  #boot = '';
  #requested_ms = -Infinity;
  #received_ms = -Infinity;

  /** @param {import('../core/store.js').Store} store */
  constructor(store) {
    this.store = store;
    store.on('beat', () => this.#receive());
  }

  /** The present moment as a fractional step number. */
  get now() {
    return this.minute.now + Math.max(0, this.store.now() - this.#received_ms) / 1000 / STEP_S;
  }

  /** The last minute of a signal. @param {Spec} spec @param {number} [now] */
  course(spec, now = this.now) {
    return this.minute.course(spec.name, now, this.store.signal(spec.name)?.period_s ?? null);
  }

  /** Adds the values of the newest frame, and requests the missed ones. */
  #receive() {
    const { frame } = this.store;
    if (!frame?.trends) return;
    const boot = `${frame.server.boot} ${frame.vehicle} ${frame.replay?.token} ${frame.replay?.seek}`; // after a seek the values before it do not belong to those after it
    if (boot !== this.#boot) {
      this.minute.clear();
      this.#requested_ms = -Infinity;
    }
    this.#boot = boot;
    this.minute.take(frame.trends);
    // The latency of the frame counts: the right edge of the picture is now, not the time at which it was sent.
    this.#received_ms = this.store.now() - 1000 * Math.max(0, this.store.lag_s);
    if (this.minute.missed !== null && this.store.now() - this.#requested_ms > REQUEST_EVERY_MS) void this.#request(this.minute.missed);
  }

  /** Requests the missed values from the server. Without an answer they stay hatched. @param {number} after the last known step */
  async #request(after) {
    this.#requested_ms = this.store.now();
    const boot = this.#boot;
    const query = new URLSearchParams(after >= 0 ? { after: String(after) } : {});
    const vehicle = this.store.frame?.vehicle;
    if (vehicle) query.set('vehicle', vehicle);
    const replay = this.store.frame?.replay;
    if (replay) query.set('replay', replay.token);
    try {
      const answer = await fetch(`/api/trends?${query}`, { cache: 'no-store' });
      if (!answer.ok || boot !== this.#boot) return;
      const found = await answer.json();
      if (typeof found?.first === 'number' && typeof found.lowest === 'object') this.minute.take(found, true);
    } catch {
      // requested again with a later frame
    }
  }
}

/** @type {WeakMap<import('../core/store.js').Store, Trends>} */
const kept = new WeakMap();

/** The last minute of this page: one for all who draw it. @param {import('../core/store.js').Store} store */
export function trendsOf(store) {
  const trends = kept.get(store) ?? new Trends(store);
  kept.set(store, trends);
  return trends;
}

/**
 * The present value of a signal as text, with its freshness.
 * @param {Spec} spec
 * @param {import('../core/store.js').Store} store
 */
export function nowOf(spec, store) {
  const { ink } = store.ink(spec.name);
  if (isAbsent(ink)) return { ink, text: ABSENT[ink], value: null };
  const now = /** @type {Record<string, any> | null | undefined} */ (store.signal(spec.name)?.value);
  const number = now?.['speed_mps'] ?? now?.['acceleration_mps2'] ?? now?.['distance_m'] ?? now?.['percent'] ?? now?.['value'];
  const { value } = shownIn(typeof number === 'number' ? number : null, spec.unit);
  const isNone = spec.name === 'distance' && now?.['none_in_range'];
  return { ink, value, text: isNone ? 'none' : (spec.isSigned ? signed : fixed)(value, spec.digits) };
}
