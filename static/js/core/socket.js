// The page's end of the socket: dials for ever, and hangs up on a connection that has gone quiet (a browser may never report
// that one is dead) and on a dial that does not open (a server may be stopped while its port still accepts).

import { Dials } from './dials.js';
import { readMessage } from './protocol.js';
import { aheadOf, isSlower, limitsOf, measured } from './round-trip.js';
import { Takes } from './takes.js';

/** A page sends at most 25 messages a second: frames are taken up to the first, a replay is led up to the second; what a person orders never waits. */
const TAKES_A_S = 24;
export const LEADS_A_S = 25;
/** Besides, so that a replay never holds up the frames: a take waits while so many of all were sent within so long [ms], a lead while so many leads were. @type {Record<string, [few: number, ms: number]>} */
const EVENLY = { take: [2, 85], replay: [2, 250] };

/**
 * @typedef {Pick<WebSocket, 'binaryType' | 'send' | 'close'> & {onopen: any, onmessage: any, onclose: any, onerror: any, dialled_ms?: number}} Socket dialled_ms: when it was, where that was not at once [ms, monotonic]
 *
 * @typedef {object} Listener
 * @property {() => void} opened
 * @property {(text: string, at_ms?: number) => void} text at_ms: when it came, where that was before now [ms, monotonic]
 * @property {(bytes: ArrayBuffer) => void} bytes
 * @property {() => void} closed
 */

/** One socket at a time. Time is an argument: the owner calls `look` a few times a second. */
export class PageSocket {
  /** The one that is open. @type {Socket | null} */
  #socket = null;
  /** One that is connecting: it takes the place of the open one once the server greets it, unless something came over that one shortly before. @type {Socket | null} */
  #next = null;
  /** How long an answer takes here, over all connections. @type {import('./round-trip.js').RoundTrip | null} */
  trip = null;
  #proof_ms = 0;
  /** When anything came. */
  #came_ms = -Infinity;
  /** Of the open one, or of the last. */
  #takes = new Takes();
  #dials;
  /** The last messages. @type {{kind: unknown, at_ms: number}[]} */
  #sent = [];

  /**
   * @param {Listener} listener
   * @param {() => Socket} dial makes a socket that is connecting
   * @param {() => number} [now] monotonic [ms]
   * @param {() => number} [chance] from 0 to 1
   */
  constructor(listener, dial, now = () => performance.now(), chance = () => Math.random()) {
    this.listener = listener;
    this.dial = dial;
    this.now = now;
    this.#dials = new Dials(chance);
  }

  get isOpen() {
    return this.#socket !== null;
  }

  /** When this connection was dialled [ms, monotonic]. */
  get dialled_ms() {
    return this.#takes.sent_ms(0);
  }

  /**
   * When that was sent which an offer answers [ms, monotonic]; of a server that does not name it, the last.
   * @param {import('./protocol-types.js').Offer} offer
   * @param {number} at_ms when it came
   */
  offered({ seq, took, of }, at_ms) {
    if (of.includes('state')) this.#takes.stateSeq = seq;
    if (took === undefined) return this.#takes.unnamed();
    const asked_ms = this.#takes.sent_ms(took);
    const isEcho = of.length === 0 && asked_ms > -Infinity;
    if (isEcho) {
      // An answer that comes too late is no proof, nor is a state that came ahead: both may have waited behind others.
      if (at_ms - asked_ms <= limitsOf(this.trip).quiet_ms) this.proof(at_ms);
      this.trip = measured(this.trip, at_ms - asked_ms);
    }
    this.#takes.received(took, aheadOf(this.trip), isEcho ? at_ms : undefined);
    return asked_ms;
  }

  /** The phone slept: states that were under way look young, for its clock may have stood still; a connection that was being dialled would bring such states too. */
  slept() {
    this.#forsake();
    if (this.#takes.areNamed === false) return; // a former server sends no state before it is taken
    this.#takes.distrust();
    this.send({ kind: 'take', seq: 0 });
  }

  /** Whether states are of after the last sleep. */
  get isTrusted() {
    return this.#takes.isTrusted;
  }

  /**
   * A frame came, fresh or not: if it was requested, the connection is alive, whatever is known of the clocks yet.
   * @param {number} at_ms
   * @param {'state' | 'cars' | 'scan'} kind
   */
  answered(at_ms, kind) {
    const takes = this.#takes;
    if (takes.got(kind === 'state') && !takes.ahead) {
      this.trip = measured(this.trip, at_ms - takes.asked_ms);
      this.proof(at_ms);
    }
    if (kind === 'state' && takes.ahead) this.takeInTurn(() => this.send({ kind: 'take', seq: 0 }), kind);
  }

  /** A message came that could not be read: a state counts all the same, or the server would take it for under way for good. @param {string} text */
  unread(text) {
    if (text.startsWith('{"kind":"state"')) this.#takes.got(true);
  }

  /**
   * A fresh frame came: the connection is alive.
   * @param {number} now_ms
   */
  proof(now_ms) {
    this.#proof_ms = now_ms;
    this.#came_ms = Math.max(this.#came_ms, now_ms);
    this.#dials.proved();
  }

  /** Something changed for the better (the page is seen again, the phone is online): dial without waiting. */
  hurry() {
    this.#dials.hurry();
  }

  /**
   * Dial where there is no socket, or beside one over which nothing comes on a slow radio; hang up where nothing fresh comes for too long.
   * @param {number} now_ms
   */
  look(now_ms) {
    const { dial_ms, quiet_ms, spare_ms } = limitsOf(this.trip);
    if (this.#socket && now_ms - this.#proof_ms > quiet_ms) this.#drop();
    if (this.#next && now_ms - this.#dials.last_ms > this.#dials.limit_ms(dial_ms, limitsOf(null).dial_ms)) this.#failedDial();
    const isSpareDue = this.#dials.isSpareDue(now_ms, this.#came_ms, spare_ms);
    if (!this.#next && (!this.#socket || isSpareDue) && this.#dials.isDue(now_ms)) this.#open(now_ms);
  }

  /**
   * Send now or not at all: nothing is kept for later.
   * @param {object} message
   * @returns {boolean} whether it went out
   */
  send(message) {
    if (!this.#socket) return false;
    const [kind, at_ms] = ['kind' in message ? message.kind : '', this.now()];
    this.#socket.send(JSON.stringify(kind === 'take' ? this.#takes.counted(message, at_ms) : message));
    this.#sent = [...this.#sent.slice(-LEADS_A_S), { kind, at_ms }];
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

  /** Take a frame in turn, of this connection; one take of a kind waits at a time, for what is taken is the newest. @param {() => void} take @param {string} [kind] */
  takeInTurn(take, kind = 'offer') {
    const takes = this.#takes;
    if (takes.waiting.has(kind)) return;
    takes.waiting.add(kind);
    this.inTurn(TAKES_A_S, () => {
      if (takes !== this.#takes) return;
      takes.waiting.delete(kind);
      take();
    }, 'take');
  }

  /** Hang up; the next `look` dials again, without waiting. */
  hangUp() {
    this.stop();
    this.hurry();
  }

  /** Hang up for good; `look` must not be called again. */
  stop() {
    this.#forsake();
    this.#close(this.#socket);
    this.#socket = null;
    this.#takes.isOwed = false;
  }

  /** @param {number} now_ms */
  #open(now_ms) {
    this.#dials.begin(now_ms);
    const socket = this.dial();
    socket.binaryType = 'arraybuffer';
    this.#next = socket;
    socket.onopen = (/** @type {{at_ms?: number} | undefined} */ event) => this.#connected(socket, socket.dialled_ms ?? now_ms, event?.at_ms ?? this.now());
    socket.onclose = () => this.#socket ? this.#unneeded() : this.#failedDial();
    socket.onerror = () => {}; // a close always follows
  }

  /** Where another one is open, only the greeting proves that the server serves this one too, and brings the page its next ticket. @param {Socket} socket @param {number} asked_ms @param {number} at_ms */
  #connected(socket, asked_ms, at_ms) {
    if (!this.#socket) return this.#opened(socket, asked_ms, at_ms);
    /** What came before the greeting, as of a car whose agent is not there. @type {{data: any}[]} */
    const came = [];
    socket.onmessage = (/** @type {{data: any}} */ event) => {
      came.push(event);
      if (this.#socket && readMessage(event.data)?.kind !== 'hello') return;
      if (this.#socket && this.now() - this.#came_ms <= limitsOf(this.trip).spare_ms) return this.#unneeded();
      this.#opened(socket, asked_ms, at_ms);
      for (const one of came) socket.onmessage(one);
    };
  }

  /** @param {Socket} socket @param {number} asked_ms @param {number} at_ms */
  #opened(socket, asked_ms, at_ms) {
    this.#next = null;
    const isInPlace = this.isOpen;
    if (isInPlace) this.#drop();
    this.#socket = socket;
    this.#dials.opened(this.now(), isInPlace);
    this.#proof_ms = this.#came_ms = this.now();
    const opened_ms = (at_ms - asked_ms) / 2; // to connect, and to become a WebSocket
    if (isSlower(this.trip, opened_ms)) this.trip = measured(null, opened_ms);
    this.#takes = new Takes(asked_ms, opened_ms, aheadOf(this.trip), this.#takes.areNamed);
    socket.onmessage = (/** @type {{data: any, at_ms?: number}} */ event) => {
      this.#came_ms = this.now();
      if (typeof event.data === 'string') return this.listener.text(event.data, event.at_ms);
      this.answered(this.now(), 'scan');
      this.listener.bytes(event.data);
    };
    socket.onclose = () => this.#drop();
    this.listener.opened();
  }

  /** The open one is gone or given up. */
  #drop() {
    this.#close(this.#socket);
    this.#socket = null;
    this.#takes.isOwed = false;
    this.#dials.gone();
    this.listener.closed();
  }

  #failedDial() {
    this.#forsake();
    this.#dials.failed();
  }

  /** The open one stays. */
  #unneeded() {
    this.#forsake();
    this.#dials.unneeded(this.now());
  }

  /** Give up the one that is connecting. */
  #forsake() {
    this.#close(this.#next);
    this.#next = null;
  }

  /** @param {Socket | null} socket */
  #close(socket) {
    if (!socket) return;
    // Forgotten before it is closed: a frame still under way on the old socket is never received.
    socket.onopen = socket.onmessage = socket.onclose = socket.onerror = null;
    socket.close();
  }
}
