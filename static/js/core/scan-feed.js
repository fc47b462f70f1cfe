// The newest scan of the laser: requested while a part of the page needs it, taken when it is offered.

import { readScan } from '../scan/scan-frame.js';

export class ScanFeed {
  /** @type {import('../scan/scan-frame.js').Scan | null} */
  newest = null;
  /** When the newest scan was requested [ms, monotonic]: it cannot be older than its own age and that. */
  at_ms = -Infinity;
  #took_ms = -Infinity;
  /** @type {Set<string>} names of what wants the scan */
  #watchers = new Set();
  #send;

  /** @param {(message: object) => boolean} send */
  constructor(send) {
    this.#send = send;
  }

  /** What was scanned was of another car. */
  forget() {
    this.newest = null;
    this.at_ms = this.#took_ms = -Infinity;
  }

  /** A connection was opened: the server knows nothing of what is wanted. */
  opened() {
    if (this.#watchers.size) this.#send({ kind: 'watch', scan: true });
  }

  /**
   * Have scans sent while anyone wants them.
   * @param {string} who
   * @param {boolean} isWanted
   */
  watch(who, isWanted) {
    const was = this.#watchers.size > 0;
    if (isWanted) this.#watchers.add(who);
    else this.#watchers.delete(who);
    if (was !== this.#watchers.size > 0) this.#send({ kind: 'watch', scan: !was });
  }

  /** The server has one. @param {number} seq @param {number} now_ms */
  offered(seq, now_ms) {
    this.#took_ms = now_ms;
    this.#send({ kind: 'take', seq });
  }

  /** It came. @param {ArrayBuffer} bytes @returns {boolean} whether it could be read */
  take(bytes) {
    const scan = readScan(bytes);
    if (!scan) return false;
    this.newest = scan;
    this.at_ms = this.#took_ms;
    return true;
  }
}
