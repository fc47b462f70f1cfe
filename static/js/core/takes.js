// The takes of one connection, when each was sent, and how many states may come ahead of them.

import { AheadWindow } from './round-trip.js';

/** Of so many takes it is known when they were sent. */
const KEPT_TAKES = 100;

export class Takes {
  /** When the last takes were sent, by their number; 0: when it was dialled. @type {Map<number, number>} */
  #sent;
  #count = 0;
  #window;
  /** States that this connection has brought. */
  #got = 0;
  /** States count again once the server has answered this take; 0: they do. */
  #trustedFrom = 0;
  /** States come without an offer: so many may be under way. */
  ahead = 0;
  /** The server names the take that an offer answers; undefined: nothing is known of it yet. @type {boolean | undefined} */
  areNamed;
  /** When the last frame was requested, or this connection; and whether it is still to come. */
  asked_ms;
  isOwed = false;
  /** The newest offer of a state; and whether that is what was requested: others come unasked. */
  stateSeq = NaN;
  #isStateOwed = false;
  /** What waits for its turn: an offer, a state that came ahead. @type {Set<string>} */
  waiting = new Set();

  /** @param {number} dialled_ms @param {number} opened_ms how long a round trip took to connect @param {number} most how many states may come ahead at most @param {boolean} [areNamed] as over the connection before */
  constructor(dialled_ms = -Infinity, opened_ms = Infinity, most = 0, areNamed = undefined) {
    this.#sent = new Map([[0, dialled_ms]]);
    this.asked_ms = dialled_ms;
    this.#window = new AheadWindow(opened_ms);
    this.areNamed = areNamed;
    this.ahead = areNamed ? Math.min(most, this.#window.size) : 0;
  }

  /** When a take was sent; −Infinity: it is none of this connection's. @param {number} number */
  sent_ms(number) {
    return this.#sent.get(number) ?? -Infinity;
  }

  /** Whether states are of after the last sleep. */
  get isTrusted() {
    return this.#trustedFrom === 0;
  }

  /** It is a former server, which names no take; when the last one was sent. */
  unnamed() {
    this.areNamed = false;
    this.ahead = this.#trustedFrom = 0;
    return this.asked_ms;
  }

  /** States are trusted once the next take was answered. */
  distrust() {
    this.#trustedFrom = this.#count + 1;
  }

  /**
   * The server had received a take.
   * @param {number} number
   * @param {number} most how many states may come ahead at most
   * @param {number} [at_ms] when the answer came, where the take was answered at once
   */
  received(number, most, at_ms) {
    this.areNamed = true;
    if (number >= this.#trustedFrom) this.#trustedFrom = 0;
    if (at_ms !== undefined) this.#window.answered(this.sent_ms(number), at_ms);
    this.ahead = Math.min(most, this.#window.size);
  }

  /** A frame came; whether that was requested. @param {boolean} isState */
  got(isState) {
    if (isState) this.#got += 1;
    const isAnswer = this.isOwed && (!isState || this.#isStateOwed);
    if (isAnswer) this.isOwed = false;
    return isAnswer;
  }

  /** A take with its number, and how many states may be under way, after so many. @param {{seq?: number}} take @param {number} at_ms */
  counted(take, at_ms) {
    [this.asked_ms, this.isOwed, this.#isStateOwed] = [at_ms, true, take.seq === this.stateSeq];
    this.#count += 1;
    this.#sent.set(this.#count, at_ms);
    this.#sent.delete(this.#count - KEPT_TAKES);
    return { ...take, n: this.#count, ...(this.ahead ? { ahead: this.ahead, got: this.#got } : {}) };
  }
}
