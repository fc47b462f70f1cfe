// The one time line of two recordings: where it stands, and the orders by which both sides follow it.

import { leaderAt, ordersOf, sharing, unionOf } from './compare-layout.js';

/** What was sought counts until its leader shows it, or for so long [ms]. */
const SOUGHT_MS = 6000;
/** The same moment is not sought again so soon: a frame of before may be under way [ms]. */
const AGAIN_MS = 500;
/** Between two frames the time line goes on for so long at most [ms]. */
const FRAME_MS = 400;

/**
 * @typedef {import('./compare-layout.js').Name} Name
 * @typedef {import('../core/protocol-types.js').ReplayState} ReplayState
 * @typedef {{replay: ReplayState, got_ms: number, isBusy: boolean, sought_s: number, sought_ms: number}} Side
 */

export class Pace {
  /** Seconds since A began. */
  #at_s = 0;
  #anchor_ms = 0;
  isPlaying = false;
  rate = 1;
  /** Where B begins. */
  shift_s = 0;
  /** While the comparison is out of sight, A goes on as the replay that it is, and B stands. */
  isAwake = false;
  /** A moment that the leader does not show yet. @type {{at_s: number, since_ms: number} | null} */
  #sought = null;
  /** @type {Partial<Record<Name, Side>>} */
  sides = {};

  /**
   * @param {Pick<import('../core/store.js').Store, 'ask' | 'now'>} store
   * @param {(sentence: string, title?: string) => void} say
   */
  constructor(store, say) {
    this.store = store;
    this.say = say;
  }

  /** Where a recording begins on the time line [s]. @param {Name} name */
  beginOf(name) {
    return name === 'a' ? 0 : this.shift_s;
  }

  /** Both are there. */
  get isReady() {
    return this.sides.a !== undefined && this.sides.b !== undefined;
  }

  /** @returns {[number, number]} */
  get union() {
    const { a, b } = this.sides;
    return a && b ? unionOf(a.replay, b.replay, this.shift_s) : [0, 1];
  }

  /** The moment of the time line now. */
  get at_s() {
    const leader = this.#leader;
    if (!this.isPlaying || this.#sought || !leader?.replay.is_playing) return this.#at_s;
    const passed_ms = Math.min(FRAME_MS, this.store.now() - this.#anchor_ms);
    return Math.min(this.union[1], this.#at_s + (passed_ms / 1000) * (leader.replay.reached_rate ?? this.rate));
  }

  get #leader() {
    const { a, b } = this.sides;
    const name = a && b ? leaderAt(this.#at_s, a.replay, b.replay, this.shift_s) : null;
    return name ? this.sides[name] : undefined;
  }

  /** A frame of one side came. @param {Name} name @param {ReplayState} replay */
  take(name, replay) {
    const side = this.sides[name];
    const isNew = side?.replay.token !== replay.token;
    this.sides[name] = { replay, got_ms: this.store.now(), isBusy: side?.isBusy ?? false, sought_s: isNew ? NaN : side.sought_s, sought_ms: side?.sought_ms ?? 0 };
    if (!this.isAwake || !this.isReady) return;
    this.#follow(name);
    this.#order('a');
    this.#order('b');
  }

  /** The comparison came in sight: what A does counts. */
  wake() {
    const { a } = this.sides;
    if (this.isAwake || !this.isReady || !a) return;
    this.isAwake = true;
    this.rate = a.replay.rate;
    this.isPlaying = a.replay.is_playing;
    this.#set(a.replay.at_s);
    this.#order('b');
  }

  /** It is out of sight. */
  sleep() {
    if (!this.isAwake) return;
    this.isAwake = false;
    if (this.isPlaying && this.sides.b?.replay.is_playing) void this.store.ask('replay', { do: 'pause', beside: true });
  }

  /** To a moment of the time line. @param {number} at_s */
  seek(at_s) {
    const [from_s, to_s] = this.union;
    this.#set(Math.min(Math.max(at_s, from_s), to_s));
    this.#sought = { at_s: this.#at_s, since_ms: this.store.now() };
    this.#orderBoth();
  }

  toggle() {
    const [from_s, to_s] = this.union;
    this.#set(this.at_s);
    this.isPlaying = !this.isPlaying;
    if (this.isPlaying && this.#at_s >= to_s - 0.05) this.seek(from_s);
    this.#orderBoth();
  }

  /** @param {number} rate */
  setRate(rate) {
    this.#set(this.at_s);
    this.rate = rate;
    this.#orderBoth();
  }

  /** B begins elsewhere; A stays where it is. @param {number} shift_s */
  setShift(shift_s) {
    const { a, b } = this.sides;
    if (!a || !b) return;
    this.shift_s = sharing(shift_s, a.replay, b.replay);
    const [from_s, to_s] = this.union;
    this.#set(Math.min(Math.max(this.at_s, from_s), to_s));
    this.#orderBoth();
  }

  /** @param {number} at_s */
  #set(at_s) {
    this.#at_s = at_s;
    this.#anchor_ms = this.store.now();
  }

  #orderBoth() {
    this.#order('a');
    this.#order('b');
  }

  /** The leader determines the position of the time line while it plays. @param {Name} name */
  #follow(name) {
    const side = this.sides[name];
    if (!side || side !== this.#leader) return;
    const { replay } = side;
    const here_s = replay.at_s + this.beginOf(name);
    const sought = this.#sought;
    if (sought) {
      const isShown = !replay.is_seeking && Math.abs(here_s - sought.at_s) < 0.5 + this.rate;
      if (!isShown && this.store.now() - sought.since_ms < SOUGHT_MS) return;
      this.#sought = null;
    }
    if (!this.isPlaying || replay.is_seeking) return;
    this.#set(here_s);
    const { a, b } = this.sides;
    if (a && b && leaderAt(here_s, a.replay, b.replay, this.shift_s) === null) this.isPlaying = false;
  }

  /** Has one side come to where the time line is; one order at a time is under way. @param {Name} name */
  async #order(name) {
    const side = this.sides[name];
    if (!side || side.isBusy || !this.isAwake) return;
    const at_s = this.at_s - this.beginOf(name);
    const orders = ordersOf(side.replay, { at_s, isPlaying: this.isPlaying, rate: this.rate })
      .filter((order) => order.do !== 'seek' || order.at_s !== side.sought_s || this.store.now() - side.sought_ms > AGAIN_MS);
    if (!orders.length) return;
    side.isBusy = true;
    for (const order of orders) {
      const answer = await this.store.ask('replay', { ...order, beside: name === 'b' });
      const now = this.sides[name];
      if (!now) return;
      if (!answer.ok) {
        now.isBusy = false;
        this.isPlaying = false;
        this.say(answer.reason ?? 'Refused.', `Recording ${name.toUpperCase()} not moved`);
        return;
      }
      if (order.do === 'seek') {
        [now.sought_s, now.sought_ms] = [order.at_s, this.store.now()];
        now.replay = { ...now.replay, at_s: order.at_s, is_seeking: true };
      } else if (order.do === 'rate') now.replay = { ...now.replay, rate: order.rate };
      else now.replay = { ...now.replay, is_playing: order.do === 'play' };
    }
    const now = this.sides[name];
    if (now) now.isBusy = false;
    void this.#order(name);
  }
}
