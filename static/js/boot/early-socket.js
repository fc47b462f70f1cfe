// The socket that was dialled before this script was here (early.js), as the page's own: what came meanwhile is delivered first.

/**
 * @typedef {{type: 'open' | 'message' | 'close', data?: string | ArrayBuffer, at_ms: number}} SocketEvent at_ms: when it came, monotonic
 * @typedef {{queue: SocketEvent[], handle: ((event: SocketEvent) => void) | null, socket: WebSocket | null, dialled_ms?: number, isGivenUp?: boolean}} Early isGivenUp: none is to be dialled any more
 */

/** The one that was dialled, once; null where there is none any more, or it failed. @returns {import('../core/socket.js').Socket | null} */
export function takeEarly() {
  const scope = /** @type {{catgraphEarly?: Early}} */ (globalThis);
  const early = scope.catgraphEarly;
  delete scope.catgraphEarly;
  return early && !early.queue.some(({ type }) => type === 'close') ? new EarlySocket(early) : null;
}

export class EarlySocket {
  /** It is set already. @type {BinaryType} */
  binaryType = 'arraybuffer';
  /** @type {any} */
  onopen = null;
  /** @type {any} */
  onmessage = null;
  /** @type {any} */
  onclose = null;
  /** @type {any} */
  onerror = null;

  get dialled_ms() {
    return this.early.dialled_ms ?? 0;
  }

  /** @param {Early} early */
  constructor(early) {
    this.early = early;
    queueMicrotask(() => { // by then the caller listens
      for (const event of early.queue.splice(0)) this.#handle(event);
      early.handle = (event) => this.#handle(event);
    });
  }

  /** @param {string} text */
  send(text) {
    this.early.socket?.send(text);
  }

  close() {
    this.early.isGivenUp = true;
    this.early.socket?.close();
  }

  /** @param {SocketEvent} event */
  #handle({ type, data, at_ms }) {
    if (type === 'open') this.onopen?.({ at_ms });
    else if (type === 'message') this.onmessage?.({ data, at_ms });
    else this.onclose?.();
  }
}
