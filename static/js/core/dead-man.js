// When the values on the glass may be believed: the page's own watch over its frames.

/** After so long without a fresh frame the values are covered [ms]. The CSS animation in veil.css has the same time. */
export const COVER_AFTER_MS = 2000;
/** A frame older than this is not service, it is a memory [ms]. */
export const STALE_FRAME_MS = 2000;
/** So many fresh frames in a row lift the veil: one may be a straggler. */
const LIFT_AFTER = 3;

/** Covers the values when frames stop, and uncovers them when they have come back for good. Time is an argument. */
export class DeadMan {
  #run = 0;
  #heard_ms = -Infinity;
  covered = false;

  /** When the last fresh frame came [ms, monotonic]; −Infinity before the first. */
  get heard_ms() {
    return this.#heard_ms;
  }

  /** Seconds without a fresh frame. @param {number} now_ms */
  silence_s(now_ms) {
    return (now_ms - this.#heard_ms) / 1000;
  }

  /**
   * A state frame came.
   * @param {number} now_ms
   * @param {number} delay_ms how long it was under way
   * @returns {boolean} whether it is fresh
   */
  frame(now_ms, delay_ms) {
    this.look(now_ms);
    if (delay_ms > STALE_FRAME_MS) {
      this.#run = 0;
      return false;
    }
    this.#heard_ms = now_ms;
    this.#run += 1;
    if (this.covered && this.#run >= LIFT_AFTER) this.covered = false;
    return true;
  }

  /** Time passed. @param {number} now_ms */
  look(now_ms) {
    if (this.#heard_ms > -Infinity && now_ms - this.#heard_ms > COVER_AFTER_MS) this.cover();
  }

  /** The page slept or is about to: what it shows on waking is the veil. */
  cover() {
    this.covered = true;
    this.#run = 0;
  }
}
