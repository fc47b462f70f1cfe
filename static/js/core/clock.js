// How old a frame is at the glass, although the clocks of server and phone never agree.

/** Two clocks drift apart by at most 100 ppm, as two crystals of ±50 ppm do: within an hour by 0.36 s. */
const DRIFT = 100e-6;
/** A frame may look younger than it is by so much at most, whatever the radio [ms]. */
const YOUNGER_MS = 200;
/** Clocks are read to a millisecond or two: a contradiction is more than that [ms]. */
const READING_MS = 5;

/**
 * Bounds how far this page's clock is ahead of the server's. A message was received after it was sent: (receive − sent) is
 * never too small. It was sent after the server had received what it follows: (request − sent) is never too large. The bounds
 * hold for one run of the server, over all connections to it, and widen by the drift.
 */
export class ServerClock {
  #run = '';
  #least_ms = -Infinity;
  #most_ms = Infinity;
  #at_ms = 0;

  /**
   * A server greeted this page: another run of one may have another clock.
   * @param {{run: string, time_ms: number}} hello
   * @param {number} at_ms
   * @param {number} asked_ms when it was dialled
   */
  greeted({ run, time_ms }, at_ms, asked_ms) {
    if (run !== this.#run) this.forget();
    this.#run = run;
    return this.note(time_ms, at_ms, asked_ms);
  }

  forget() {
    this.#least_ms = -Infinity;
    this.#most_ms = Infinity;
  }

  /**
   * Note a message made at `time_ms` (server's wall clock) and received at `at_ms` (page's monotonic clock).
   * @param {number | undefined} time_ms undefined: of an offer of a former server
   * @param {number} at_ms
   * @param {number} [asked_ms] when that was sent which the server had received before `time_ms`; left out: not known
   * @returns {number} how old it is [ms], ≥ 0; by at most 200 ms too little once any `asked_ms` is known
   */
  note(time_ms, at_ms, asked_ms = -Infinity) {
    if (time_ms === undefined) return 0;
    const drift_ms = Math.max(0, at_ms - this.#at_ms) * DRIFT;
    this.#at_ms = at_ms;
    this.#least_ms -= drift_ms;
    this.#most_ms += drift_ms;
    const [least_ms, most_ms] = [asked_ms - time_ms, at_ms - time_ms];
    if (most_ms < this.#least_ms - READING_MS || least_ms > this.#most_ms + READING_MS) this.forget(); // a clock was set, or stood still in a sleep
    this.#least_ms = Math.max(this.#least_ms, least_ms);
    this.#most_ms = Math.min(this.#most_ms, most_ms);
    const ahead_ms = this.#least_ms > -Infinity ? Math.min(this.#most_ms, this.#least_ms + YOUNGER_MS) : this.#most_ms;
    return most_ms - ahead_ms;
  }
}
