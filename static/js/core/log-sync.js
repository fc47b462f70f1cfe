// Keeps the log of events as the server has it: greets the server with what this page has, takes what follows.

/** @typedef {import('./protocol-types.js').Hello} Hello */

export class LogSync {
  /** The answer to the server's greeting, while it is owed. @type {(() => void) | null} */
  #owed = null;
  #mayGreet = false;
  /** The server knows who this page is, on this connection: before, it files a command under nobody. */
  hasGreeted = false;
  #log;
  #send;
  #emitter;

  /**
   * @param {import('./event-log.js').EventLog} log
   * @param {(message: object) => boolean} send
   * @param {import('./emitter.js').Emitter<import('./store.js').Topic>} emitter gets `log`, `gap` and `open`
   */
  constructor(log, send, emitter) {
    this.#log = log;
    this.#send = send;
    this.#emitter = emitter;
  }

  /** From now on the server's greeting is answered: who a page is that just begins can wait until it shows the car. */
  greet() {
    this.#mayGreet = true;
    this.#owed?.();
  }

  /** Whenever the server greets this page, and at once where it has. @param {() => void} listener */
  whenOpen(listener) {
    if (this.#log.boot !== null) listener();
    return this.#emitter.on('open', listener);
  }

  /**
   * The server greets.
   * @param {Hello} hello
   * @param {{name: string, build?: string, page?: string}} self who this page is
   * @param {number} blind_s for so long nothing fresh had come
   */
  greeted(hello, self, blind_s) {
    const have_event = this.#log.greet(hello, blind_s, Date.now());
    this.#owed = () => {
      this.#owed = null;
      this.hasGreeted = this.#send({ kind: 'hello', have_event, boot: this.#log.boot, ...self });
    };
    if (this.#mayGreet) this.#owed();
    this.#caughtUp();
    this.#emitter.emit('open', hello);
  }

  /** @param {import('./protocol-types.js').LogEvent[]} events @param {import('./protocol-types.js').Resumed} [resumed] */
  take(events, resumed) {
    if (this.#owed) { // they came before this page reported its newest event: from there they are sent again, and in order
      this.#owed();
      this.#send({ kind: 'have', event: this.#log.last ?? 0 });
      return;
    }
    const fresh = this.#log.take(events, resumed);
    this.#send({ kind: 'have', event: this.#log.last ?? 0 });
    if (fresh.length) this.#emitter.emit('log', fresh);
    this.#caughtUp();
  }

  closed() {
    this.#owed = null;
    this.hasGreeted = false;
  }

  #caughtUp() {
    const gap = this.#log.caughtUp();
    if (gap) this.#emitter.emit('gap', gap);
  }
}
