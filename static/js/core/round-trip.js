// What the radio needs: the round trip and its spread as RFC 6298 has them, and the limits of a connection by them.

/**
 * @typedef {{mean_ms: number, spread_ms: number}} RoundTrip smoothed round trip, and its mean deviation
 * @typedef {{dial_ms: number, ticket_ms: number, quiet_ms: number, spare_ms: number}} Limits a socket that does not open, a ticket that does not come, and a connection without a fresh frame are given up after so long; beside one that is quiet another is dialled after spare_ms
 */

/** Above this the radio is called weak. */
const WEAK_MS = 300;
/** Above this a state for each round trip is too few. */
const AHEAD_MS = 100;
/** So many states may then be under way at most: as many as the server sends within 1.8 s. */
const AHEAD = 12;
/** And so many at first. */
const FIRST_AHEAD = 3;
/** States may wait for each other so long on a radio that carries little; and of so many late answers in a row one was not late by loss. */
const QUEUE_MS = 400;
const LATE_IN_A_ROW = 3;
/** Before anything is measured, the slowest radio is assumed. @type {Limits} */
const UNKNOWN = { dial_ms: 5000, ticket_ms: 5000, quiet_ms: 5000, spare_ms: Infinity };
/** The system repeats an unanswered request for a connection after 1 s (RFC 6298, 2.1): sooner, no limit may end. */
const REPEATED_MS = 1000;
const LONGEST_MS = 8000;
const QUIET_AT_LEAST_MS = 2500;
/** A packet and its first repetition take so long over a slow radio; an earlier dial would only add to what it carries. */
const SPARE_AT_LEAST_MS = 1000;
const SPARE_AT_MOST_MS = 1500;
/** From one frame to the next offer, with a late one between. */
const OFFERED_MS = 1000;

/**
 * The estimate with one more measurement (RFC 6298, 2.2 and 2.3).
 * @param {RoundTrip | null} trip null: there was none yet
 * @param {number} waited_ms
 * @returns {RoundTrip}
 */
export function measured(trip, waited_ms) {
  const sample_ms = Math.min(waited_ms, LONGEST_MS); // longer, the page itself stood still
  if (!trip) return { mean_ms: sample_ms, spread_ms: sample_ms / 2 };
  return {
    mean_ms: trip.mean_ms + (sample_ms - trip.mean_ms) / 8,
    spread_ms: trip.spread_ms + (Math.abs(sample_ms - trip.mean_ms) - trip.spread_ms) / 4,
  };
}

/** Whether a measurement does not fit what was known. @param {RoundTrip | null} trip @param {number} sample_ms */
export function isSlower(trip, sample_ms) {
  return trip === null || sample_ms > trip.mean_ms + 4 * trip.spread_ms;
}

/** @param {RoundTrip | null} trip @returns {Limits} */
export function limitsOf(trip) {
  if (!trip) return UNKNOWN;
  const answer_ms = trip.mean_ms + 4 * trip.spread_ms; // RFC 6298's time-out
  const dial_ms = Math.min(LONGEST_MS, 2 * REPEATED_MS + answer_ms);
  return {
    dial_ms,
    ticket_ms: Math.max(UNKNOWN.ticket_ms, dial_ms),
    quiet_ms: Math.min(LONGEST_MS, Math.max(QUIET_AT_LEAST_MS, OFFERED_MS + answer_ms)),
    spare_ms: aheadOf(trip) ? Math.min(SPARE_AT_MOST_MS, Math.max(SPARE_AT_LEAST_MS, 2 * trip.mean_ms)) : Infinity,
  };
}

/** @param {RoundTrip | null} trip */
export function isWeak(trip) {
  return trip !== null && trip.mean_ms >= WEAK_MS;
}

/** How many states may come ahead of the next take. @param {RoundTrip | null} trip */
export function aheadOf(trip) {
  return trip !== null && trip.mean_ms >= AHEAD_MS ? AHEAD : 0;
}

/** How many states may be under way: fewer where each answer is late, for they then wait behind each other. Of one connection. */
export class AheadWindow {
  size = FIRST_AHEAD;
  #least_ms;
  #changed_ms = -Infinity;
  /** Answers in a row that were late. @type {number[]} */
  #late_ms = [];

  /** @param {number} least_ms a round trip with nothing under way */
  constructor(least_ms) {
    this.#least_ms = least_ms;
  }

  /**
   * A take was answered.
   * @param {number} asked_ms
   * @param {number} at_ms
   */
  answered(asked_ms, at_ms) {
    if (asked_ms < this.#changed_ms) return; // before, more were under way
    const waited_ms = at_ms - asked_ms;
    this.#least_ms = Math.min(this.#least_ms, waited_ms);
    const most_ms = this.#least_ms + QUEUE_MS;
    this.#late_ms = waited_ms > most_ms ? [...this.#late_ms, waited_ms] : [];
    if (this.#late_ms.length === 0) this.size = Math.min(AHEAD, this.size + 1);
    if (this.#late_ms.length < LATE_IN_A_ROW) return;
    this.size = Math.max(1, Math.floor(this.size * most_ms / Math.min(...this.#late_ms)));
    this.#late_ms = [];
    this.#changed_ms = at_ms;
  }
}
