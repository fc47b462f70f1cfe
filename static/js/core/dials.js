// When the page dials: again after a connection that is gone, and another one beside one over which nothing comes.

/** Of so many dials in a row one gets twice the time, and that of an unknown radio at least: it may be another one than was measured. */
const DIALS_A_LONG_ONE = 3;
/** No other dial takes longer: the system repeats its request after 4, 6 and 10 s, or after 3, 7 and 15 s, and each dial makes one at once [ms]. */
const LONGEST_DIAL_MS = 8000;
/** Where dials take as long, one of so many in a row gets twice that: a connection, TLS and upgrade may need it. */
const DIALS_A_LONGEST_ONE = 9;
/** Least time from one dial to the next [ms]. */
const FIRST_WAIT_MS = 300;
const LAST_WAIT_MS = 2000;
/** Waits are longer by up to this share, by chance: pages that one server kept waiting do not all dial at once. */
const SPREAD = 0.5;
/** After another connection that was not needed, or that was needed so soon after the one before, the next one waits so long; twice as long after each further one, until there was none for a while [ms]. */
const FIRST_SPARE_MS = 1000;
const LAST_SPARE_MS = 10_000;
const CALM_MS = 60_000;
const SOON_MS = 30_000;
/** After one that took the place of another it waits so long at most: over a radio that loses much, two may be needed in a row [ms]. */
const LAST_SWAPPED_MS = 4000;

/** Of one page. Time is an argument. */
export class Dials {
  last_ms = -Infinity;
  /** In a row that did not open. */
  #failed = 0;
  #wait_ms = FIRST_WAIT_MS;
  #may_ms = -Infinity;
  /** By how much the next waits are longer. */
  #longer = 1;
  #spareWait_ms = FIRST_SPARE_MS;
  #maySpare_ms = -Infinity;
  /** When one took the place of another. */
  #swapped_ms = -Infinity;
  #looked_ms = -Infinity;

  /** @param {() => number} chance from 0 to 1 */
  constructor(chance) {
    this.chance = chance;
  }

  /** @param {number} now_ms */
  isDue(now_ms) {
    return now_ms >= this.#may_ms;
  }

  /**
   * Whether another one is due beside the open one.
   * @param {number} now_ms
   * @param {number} came_ms when anything came last
   * @param {number} limit_ms nothing may come for so long
   */
  isSpareDue(now_ms, came_ms, limit_ms) {
    const wait_ms = this.#longer * limit_ms;
    const isLate = now_ms - this.#looked_ms > wait_ms; // the page itself stood still: what came meanwhile may not be read yet
    this.#looked_ms = now_ms;
    return !isLate && now_ms >= this.#maySpare_ms && now_ms - came_ms > wait_ms;
  }

  /** After so long one that does not open is given up. @param {number} dial_ms @param {number} longest_ms */
  limit_ms(dial_ms, longest_ms) {
    const dials = this.#failed + 1;
    if (dials % DIALS_A_LONG_ONE) return dial_ms;
    const limit_ms = Math.min(LONGEST_DIAL_MS, Math.max(2 * dial_ms, longest_ms));
    return limit_ms === LONGEST_DIAL_MS && dials % DIALS_A_LONGEST_ONE === 0 ? 2 * limit_ms : limit_ms;
  }

  /** @param {number} now_ms */
  begin(now_ms) {
    this.last_ms = now_ms;
    this.#longer = 1 + SPREAD * this.chance();
  }

  /** @param {number} now_ms @param {boolean} isInPlace of one that was open */
  opened(now_ms, isInPlace) {
    this.#failed = 0;
    if (!isInPlace) return;
    if (now_ms - this.#swapped_ms < SOON_MS) this.unneeded(now_ms, LAST_SWAPPED_MS); // the radio may carry too little for two
    else this.#spareWait_ms = FIRST_SPARE_MS;
    this.#swapped_ms = now_ms;
  }

  /** The open one answered before it, or the server refused it. @param {number} now_ms @param {number} [longest_ms] the next one waits at most */
  unneeded(now_ms, longest_ms = LAST_SPARE_MS) {
    if (now_ms - this.#maySpare_ms > CALM_MS) this.#spareWait_ms = FIRST_SPARE_MS;
    this.#maySpare_ms = now_ms + this.#longer * Math.min(longest_ms, this.#spareWait_ms);
    this.#spareWait_ms = Math.min(LAST_SPARE_MS, 2 * this.#spareWait_ms);
  }

  failed() {
    this.#failed += 1;
    this.gone();
  }

  /** Where each one fails at once, they become seldom. */
  gone() {
    this.#may_ms = this.last_ms + this.#longer * this.#wait_ms;
    this.#wait_ms = Math.min(LAST_WAIT_MS, this.#wait_ms * 1.7);
  }

  /** The connection is alive. */
  proved() {
    this.#wait_ms = FIRST_WAIT_MS;
  }

  /** Without waiting. */
  hurry() {
    this.#may_ms = -Infinity;
    this.proved();
  }
}
