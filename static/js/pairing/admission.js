// How this page is let in where devices are paired: each socket with a fresh ticket, and the pairing screen where there is none.

/** A ticket that does not come by then is asked for again with the next socket [ms]. */
const TICKET_MS = 4000;

/**
 * @typedef {{code?: string, detail?: string}} Refusal as the server words it
 */

export class Admission {
  /** While the device is not paired: goes on once it is. @type {{promise: Promise<void>, go: () => void} | null} */
  #shut = null;

  /**
   * @param {() => string} address of the socket
   * @param {(why: Refusal) => void} onShut this device is not paired, or not any more
   */
  constructor(address, onShut) {
    this.address = address;
    this.onShut = onShut;
  }

  /** A socket that is connecting, as `new WebSocket` gives one. @returns {import('../core/socket.js').Socket} */
  dial() {
    return new TicketSocket(this.address(), (isWanted) => this.#ticket(isWanted));
  }

  /** The device was paired: what waits goes on. */
  admit() {
    this.#shut?.go();
    this.#shut = null;
  }

  /** @param {() => boolean} isWanted @returns {Promise<string | null>} */
  async #ticket(isWanted) {
    while (isWanted()) {
      if (this.#shut) {
        await this.#shut.promise;
        continue;
      }
      const answer = await fetch('/api/ticket', { method: 'POST', cache: 'no-store', signal: AbortSignal.timeout(TICKET_MS) });
      if (answer.ok) return (await answer.json()).ticket;
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

  /** @param {string} address @param {(isWanted: () => boolean) => Promise<string | null>} ticketOf */
  constructor(address, ticketOf) {
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
    socket.binaryType = this.binaryType;
    socket.onopen = () => this.onopen?.();
    socket.onmessage = (event) => this.onmessage?.(event);
    socket.onclose = () => this.onclose?.();
    socket.onerror = () => this.onerror?.();
  }
}
