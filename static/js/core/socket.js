// The page's end of the socket: dials for ever, and hangs up on a connection that has gone quiet (a browser may never report
// that one is dead) and on a dial that does not open (a server may be stopped while its port still accepts).

import { isSlower, limitsOf, measured } from './round-trip.js';

/** Of so many dials in a row one gets twice the time, and that of an unknown radio at least: it may be another one than was measured. */
const DIALS_A_LONG_ONE = 3;
/** Least time from one dial to the next [ms]. */
const FIRST_WAIT_MS = 300;
const LAST_WAIT_MS = 2000;
/** A page sends at most 25 messages a second: frames are taken up to the first, a replay is led up to the second; what a person orders never waits. */
const TAKES_A_S = 24;
export const LEADS_A_S = 25;
/** Besides, so that a replay never holds up the frames: a take waits while so many of all were sent within so long [ms], a lead while so many leads were. @type {Record<string, [few: number, ms: number]>} */
const EVENLY = { take: [2, 85], replay: [2, 250] };

/**
 * @typedef {Pick<WebSocket, 'binaryType' | 'send' | 'close'> & {onopen: any, onmessage: any, onclose: any, onerror: any, dialled_ms?: number}} Socket dialled_ms: when it was, where that was not at once [ms, monotonic]
 *
 * @typedef {object} Ear
 * @property {() => void} opened
 * @property {(text: string, at_ms?: number) => void} text at_ms: when it came, where that was before now [ms, monotonic]
 * @property {(bytes: ArrayBuffer) => void} bytes
 * @property {() => void} closed
 */

/** One socket at a time. Time is an argument: whoever owns it calls `look` a few times a second. */
export class PageSocket {
  /** @type {Socket | null} */
  #socket = null;
  #isOpen = false;
  /** How long an answer takes here, over all connections. @type {import('./round-trip.js').RoundTrip | null} */
  trip = null;
  #proof_ms = 0;
  #dialled_ms = -Infinity;
  /** Dials in a row that did not open. */
  #failed = 0;
  /** When the last frame was asked for, or this connection; and whether it is still to come. */
  #asked_ms = -Infinity;
  #isOwed = false;
  #wait_ms = FIRST_WAIT_MS;
  #next_ms = -Infinity;
  /** The last messages. @type {{kind: unknown, at_ms: number}[]} */
  #sent = [];
  #isTaking = false;

  /**
   * @param {Ear} ear
   * @param {() => Socket} dial makes a socket that is connecting
   * @param {() => number} [now] monotonic [ms]
   */
  constructor(ear, dial, now = () => performance.now()) {
    this.ear = ear;
    this.dial = dial;
    this.now = now;
  }

  get isOpen() {
    return this.#isOpen;
  }

  /** When that was sent which the server has answered by its next offer or greeting [ms, monotonic]. */
  get asked_ms() {
    return this.#asked_ms;
  }

  /** A frame came, fresh or not: if it was asked for, the connection is alive, whatever is known of the clocks yet. @param {number} at_ms */
  answered(at_ms) {
    if (!this.#isOwed) return;
    this.#isOwed = false;
    this.trip = measured(this.trip, at_ms - this.#asked_ms);
    this.proof(at_ms);
  }

  /**
   * A fresh frame came: the connection is alive.
   * @param {number} now_ms
   */
  proof(now_ms) {
    this.#proof_ms = now_ms;
    this.#wait_ms = FIRST_WAIT_MS;
  }

  /** Something changed for the better (the page is seen again, the phone is online): dial without waiting. */
  hurry() {
    this.#next_ms = -Infinity;
    this.#wait_ms = FIRST_WAIT_MS;
  }

  /**
   * Dial where there is no socket, hang up where it is quiet.
   * @param {number} now_ms
   */
  look(now_ms) {
    if (this.#socket && now_ms - this.#proof_ms > this.#limit_ms()) this.#drop();
    if (!this.#socket && now_ms >= this.#next_ms) this.#open(now_ms);
  }

  #limit_ms() {
    const { dial_ms, quiet_ms } = limitsOf(this.trip);
    if (this.#isOpen) return quiet_ms;
    return this.#failed % DIALS_A_LONG_ONE === DIALS_A_LONG_ONE - 1 ? Math.max(2 * dial_ms, limitsOf(null).dial_ms) : dial_ms;
  }

  /**
   * Send now or not at all: nothing is kept for later.
   * @param {object} message
   * @returns {boolean} whether it went out
   */
  send(message) {
    if (!this.#socket || !this.#isOpen) return false;
    this.#socket.send(JSON.stringify(message));
    const [kind, at_ms] = ['kind' in message ? message.kind : '', this.now()];
    this.#sent = [...this.#sent.slice(-LEADS_A_S), { kind, at_ms }];
    if (kind === 'take') [this.#asked_ms, this.#isOwed] = [at_ms, true];
    return true;
  }

  /**
   * Run once fewer than `most` messages were sent within a second; where that is so, at once.
   * @param {number} most
   * @param {() => void} run
   * @param {string} [kind] by which it is spread evenly
   */
  inTurn(most, run, kind = '') {
    const [few, within_ms] = EVENLY[kind] ?? [most, 0];
    const counted = kind === 'replay' ? this.#sent.filter((one) => one.kind === kind) : this.#sent;
    const wait_ms = Math.max(1000 + (this.#sent.at(-most)?.at_ms ?? -Infinity), within_ms + (counted.at(-few)?.at_ms ?? -Infinity)) - this.now();
    if (wait_ms > 0) setTimeout(() => this.inTurn(most, run, kind), wait_ms);
    else run();
  }

  /** Take a frame in turn; one take waits at a time, for what is taken is the newest. @param {() => void} take */
  takeInTurn(take) {
    if (this.#isTaking) return;
    this.#isTaking = true;
    this.inTurn(TAKES_A_S, () => {
      this.#isTaking = false;
      take();
    }, 'take');
  }

  /** Hang up; the next `look` dials again, without waiting. */
  hangUp() {
    this.#hangUp();
    this.hurry();
  }

  /** Hang up for good; `look` must not be called again. */
  stop() {
    this.#hangUp();
  }

  /** @param {number} now_ms */
  #open(now_ms) {
    this.#proof_ms = this.#dialled_ms = now_ms;
    const socket = this.dial();
    socket.binaryType = 'arraybuffer';
    this.#socket = socket;
    socket.onopen = (/** @type {{at_ms?: number} | undefined} */ event) => {
      this.#isOpen = true;
      this.#failed = 0;
      this.#proof_ms = this.now();
      this.#asked_ms = socket.dialled_ms ?? now_ms;
      const opened_ms = ((event?.at_ms ?? this.#proof_ms) - this.#asked_ms) / 2; // to connect, and to become a WebSocket
      if (isSlower(this.trip, opened_ms)) this.trip = measured(null, opened_ms);
      this.ear.opened();
    };
    socket.onmessage = (/** @type {{data: any, at_ms?: number}} */ event) => {
      if (typeof event.data === 'string') this.ear.text(event.data, event.at_ms);
      else {
        this.answered(this.now());
        this.ear.bytes(event.data);
      }
    };
    socket.onclose = () => this.#drop();
    socket.onerror = () => {}; // a close always follows
  }

  #drop() {
    const wasOpen = this.#isOpen;
    if (!wasOpen) this.#failed += 1;
    this.#hangUp();
    this.#next_ms = this.#dialled_ms + this.#wait_ms;
    this.#wait_ms = Math.min(LAST_WAIT_MS, this.#wait_ms * 1.7);
    if (wasOpen) this.ear.closed();
  }

  #hangUp() {
    const socket = this.#socket;
    this.#socket = null;
    this.#isOpen = this.#isOwed = false;
    if (!socket) return;
    // Forgotten before it is closed: a frame still under way on the old socket is never heard again.
    socket.onopen = socket.onmessage = socket.onclose = socket.onerror = null;
    socket.close();
  }
}
