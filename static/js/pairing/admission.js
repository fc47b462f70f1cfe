// How this page is let in where devices are paired: each socket with a fresh ticket, and the pairing screen where there is none.

import { readMessage } from '../core/protocol.js';
import { limitsOf } from '../core/round-trip.js';

const A_DAY_MS = 86_400_000;

/**
 * @typedef {{code?: string, detail?: string}} Refusal as the server formulates it
 */

export class Admission {
  /** While the device is not paired: goes on once it is. @type {{promise: Promise<void>, go: () => void} | null} */
  #shut = null;
  /** For the next socket, given with the one before. @type {string | null} */
  #next = null;
  /** When one was fetched last: the answer to it renews the cookie of this device. */
  #fetched_ms = Date.now();

  /**
   * @param {() => string} address of the socket
   * @param {(why: Refusal) => void} onShut this device is not paired, or not any more
   */
  constructor(address, onShut) {
    this.address = address;
    this.onShut = onShut;
  }

  /** The server greeted this page. @param {import('../core/protocol-types.js').Hello} hello */
  greeted({ ticket }) {
    this.#next = (Date.now() - this.#fetched_ms < A_DAY_MS ? ticket : null) || null; // a server of before sends none
  }

  /**
   * A socket that is connecting, as `new WebSocket` gives one.
   * @param {import('../core/round-trip.js').RoundTrip | null} trip how long an answer takes here
   * @returns {import('../core/socket.js').Socket}
   */
  dial(trip) {
    const next = this.#next;
    const ticketOf = next === null ? (/** @type {() => boolean} */ isWanted) => this.#ticket(isWanted, limitsOf(trip).ticket_ms) : async () => next;
    // One of a socket that is given up before was hardly shown.
    return new TicketSocket(this.address(), ticketOf, (hello) => this.greeted(hello), () => { if (this.#next === next) this.#next = null; });
  }

  /** The device was paired: what waited so long is dialled anew. @param {{hangUp: () => void}} socket */
  admit(socket) {
    socket.hangUp();
    this.#shut?.go();
    this.#shut = null;
  }

  /** @param {() => boolean} isWanted @param {number} within_ms @returns {Promise<string | null>} */
  async #ticket(isWanted, within_ms) {
    while (isWanted()) {
      if (this.#shut) {
        await this.#shut.promise;
        continue;
      }
      const answer = await fetch('/api/ticket', { method: 'POST', cache: 'no-store', signal: AbortSignal.timeout(within_ms) });
      if (answer.ok) {
        this.#fetched_ms = Date.now();
        return (await answer.json()).ticket;
      }
      if (answer.status !== 401) return null;
      const why = await answer.json().catch(() => ({}));
      if (!this.#shut) {
        this.#shut = gate();
        this.onShut(why);
      }
    }
    return null;
  }
}

function gate() {
  let go = () => {};
  const promise = new Promise((/** @type {(value: void) => void} */ resolve) => { go = () => resolve(); });
  return { promise, go };
}

/** A socket that fetches its ticket first. Without one it closes as a socket that could not open. */
class TicketSocket {
  /** @type {BinaryType} */
  binaryType = 'blob';
  /** @type {any} */
  onopen = null;
  /** @type {any} */
  onmessage = null;
  /** @type {any} */
  onclose = null;
  /** @type {any} */
  onerror = null;
  /** @type {WebSocket | null} */
  #socket = null;
  #isClosed = false;
  #onHello;
  #onUsed;
  /** @type {number | undefined} */
  dialled_ms;

  /**
   * @param {string} address
   * @param {(isWanted: () => boolean) => Promise<string | null>} ticketOf
   * @param {(hello: import('../core/protocol-types.js').Hello) => void} onHello also of a socket that the page then does not need: it used the ticket up, and brings the next
   * @param {() => void} onUsed the ticket was shown: the socket opened, or closed by itself before
   */
  constructor(address, ticketOf, onHello, onUsed) {
    this.#onHello = onHello;
    this.#onUsed = onUsed;
    ticketOf(() => !this.#isClosed).catch(() => null).then((ticket) => this.#open(address, ticket));
  }

  /** @param {string} text */
  send(text) {
    this.#socket?.send(text);
  }

  close() {
    this.#isClosed = true;
    this.#socket?.close();
  }

  /** @param {string} address @param {string | null} ticket */
  #open(address, ticket) {
    if (this.#isClosed) return;
    if (ticket === null) {
      this.onclose?.();
      return;
    }
    const socket = new WebSocket(`${address}${address.includes('?') ? '&' : '?'}ticket=${encodeURIComponent(ticket)}`);
    this.#socket = socket;
    this.dialled_ms = performance.now();
    let isGreeted = false;
    socket.binaryType = this.binaryType;
    socket.onopen = () => {
      this.#onUsed();
      this.onopen?.();
    };
    socket.onmessage = (event) => {
      const hello = isGreeted ? null : readMessage(event.data);
      if (hello?.kind === 'hello') {
        isGreeted = true;
        this.#onHello(hello);
      }
      this.onmessage?.(event);
    };
    socket.onclose = () => {
      if (!isGreeted && !this.#isClosed) this.#onUsed();
      this.onclose?.();
    };
    socket.onerror = () => this.onerror?.();
  }
}
