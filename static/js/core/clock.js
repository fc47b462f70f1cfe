// How old a frame is at the glass, although the clocks of server and phone never agree.

/** Two clocks may drift apart by this much, 200 ppm: more than any phone's, and less than a congested link pretends. */
const DRIFT = 0.0002;

/**
 * Estimates the offset of the server's clock as the least (receive − sent) seen on this connection: the fastest frame
 * had the least delay. What is above that least is delay, hence age. A steady delay is never taken for an offset.
 */
export class ServerClock {
  #least_ms = Infinity;
  #at_ms = 0;

  /** Forget: a new connection cannot bring frames older than itself, so its first message starts afresh. */
  reset() {
    this.#least_ms = Infinity;
  }

  /**
   * Note a message sent at `time_ms` (server's wall clock) and received at `at_ms` (page's monotonic clock).
   * @param {number} time_ms
   * @param {number} at_ms
   * @returns {number} how long it was under way, beyond the least possible [ms], ≥ 0
   */
  note(time_ms, at_ms) {
    const drifted_ms = this.#least_ms + Math.max(0, at_ms - this.#at_ms) * DRIFT;
    this.#at_ms = at_ms;
    this.#least_ms = Math.min(drifted_ms, at_ms - time_ms);
    return at_ms - time_ms - this.#least_ms;
  }
}
