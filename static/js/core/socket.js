// The page's end of the socket: dials for ever, and hangs up on a connection that has gone quiet.

/** A browser may never report a dead connection: without a fresh frame for so long it is given up [ms]. */
const QUIET_MS = 2500;
/** A dial that has not opened by then is given up: the server may be stopped while its port still accepts [ms]. */
const DIAL_MS = 5000;
const FIRST_WAIT_MS = 300;
const LAST_WAIT_MS = 2000;
/** A page sends at most 25 messages a second: frames are taken up to the first, a replay is led up to the second; what a person orders never waits. */
const TAKES_A_S = 24;
export const LEADS_A_S = 25;
/** Besides, so that a replay never holds up the frames: a take waits while so many of all were sent within so long [ms], a lead while so many leads were. @type {Record<string, [few: number, ms: number]>} */
const EVENLY = { take: [2, 85], replay: [2, 250] };

/**
 * @typedef {Pick<WebSocket, 'binaryType' | 'send' | 'close'> & {onopen: any, onmessage: any, onclose: any, onerror: any}} Socket
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
  #proof_ms = 0;
  #wait_ms = FIRST_WAIT_MS;
  #next_ms = -Infinity;
  /** The last messages. @type {{kind: unknown, at_ms: number}[]} */
  #sent = [];
  #isTaking = false;

  /**
   * @param {Ear} ear
   * @param {() => Socket} dial makes a socket that is connecting
   */
  constructor(ear, dial) {
    this.ear = ear;
    this.dial = dial;
  }

  get isOpen() {
    return this.#isOpen;
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
    if (this.#socket && now_ms - this.#proof_ms > (this.#isOpen ? QUIET_MS : DIAL_MS)) this.#drop(now_ms);
    if (!this.#socket && now_ms >= this.#next_ms) this.#open(now_ms);
  }

  /**
   * Send now or not at all: nothing is kept for later.
   * @param {object} message
   * @returns {boolean} whether it went out
   */
  send(message) {
    if (!this.#socket || !this.#isOpen) return false;
    this.#socket.send(JSON.stringify(message));
    this.#sent = [...this.#sent.slice(-LEADS_A_S), { kind: 'kind' in message ? message.kind : '', at_ms: performance.now() }];
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
    const wait_ms = Math.max(1000 + (this.#sent.at(-most)?.at_ms ?? -Infinity), within_ms + (counted.at(-few)?.at_ms ?? -Infinity)) - performance.now();
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
    this.#proof_ms = now_ms;
    const socket = this.dial();
    socket.binaryType = 'arraybuffer';
    this.#socket = socket;
    socket.onopen = () => {
      this.#isOpen = true;
      this.ear.opened();
    };
    socket.onmessage = (/** @type {{data: any, at_ms?: number}} */ event) => {
      if (typeof event.data === 'string') this.ear.text(event.data, event.at_ms);
      else this.ear.bytes(event.data);
    };
    socket.onclose = () => this.#drop(performance.now());
    socket.onerror = () => {}; // a close always follows
  }

  /** @param {number} now_ms */
  #drop(now_ms) {
    const wasOpen = this.#isOpen;
    this.#hangUp();
    this.#next_ms = now_ms + this.#wait_ms;
    this.#wait_ms = Math.min(LAST_WAIT_MS, this.#wait_ms * 1.7);
    if (wasOpen) this.ear.closed();
  }

  #hangUp() {
    const socket = this.#socket;
    this.#socket = null;
    this.#isOpen = false;
    if (!socket) return;
    // Forgotten before it is closed: a frame still under way on the old socket is never heard again.
    socket.onopen = socket.onmessage = socket.onclose = socket.onerror = null;
    socket.close();
  }
}
