// What a phone tells of its position, and when: pure functions of time, without the browser's geolocation.

/**
 * @typedef {'denied' | 'unavailable' | 'timeout' | 'insecure' | 'hidden' | 'off'} Why
 * @typedef {{latitude: number, longitude: number, accuracy: number, altitude: number | null, speed: number | null, heading: number | null}} Coords
 * @typedef {{lat_deg: number, lon_deg: number, accuracy_m: number, alt_m: number | null, speed_mps: number | null, heading_deg: number | null, at_ms: number, age_s: number}} Fix
 * @typedef {{fix: Fix} | {why: Why}} PositionReport
 */

/** A position at most so often [ms]. */
const FIX_EVERY_MS = 1000;
/** A reason again after so long: the server considers a phone lost that sends nothing for 5 s [ms]. */
const WHY_EVERY_MS = 3000;
/** Without a fix for so long the phone waits for one; a single failure in between is none [ms]. */
const NO_FIX_MS = 4000;

/** So many fixes show how the receiver's clock differs from the browser's … */
const LAGS = 10;
const LAGS_TO_KNOW = 3;
/** … if none of them seems younger than this [ms]: a receiver's delay is shorter. */
const LONGEST_DELAY_MS = 5000;

/**
 * How old a fix is. Its stamp may be satellite time while the browser's clock was set by hand: where the two cannot be one
 * clock (every fix seems old, or from the future), a fix counts as late as it is beyond the most prompt of the last ten.
 */
export class FixClock {
  /** @type {number[]} */
  #lags_ms = [];

  /**
   * Note a fix stamped `stamp_ms` that came when the browser's wall clock showed `wall_ms`.
   * @param {number} stamp_ms
   * @param {number} wall_ms
   * @returns {number} its age when it came [ms], ≥ 0
   */
  note(stamp_ms, wall_ms) {
    const lag_ms = wall_ms - stamp_ms;
    this.#lags_ms = [...this.#lags_ms, lag_ms].slice(-LAGS);
    const least_ms = Math.min(...this.#lags_ms);
    const isOtherClock = this.#lags_ms.length >= LAGS_TO_KNOW && (least_ms < 0 || least_ms > LONGEST_DELAY_MS);
    return Math.max(0, isOtherClock ? lag_ms - least_ms : lag_ms);
  }
}

/** A number that JSON can carry, or null. @param {number | null | undefined} value */
function known(value) {
  return typeof value === 'number' && Number.isFinite(value) ? value : null;
}

/** Decides what of the position is to be sent now. Times are the page's monotonic clock [ms] but where `wall_ms` stands. */
export class PositionReporter {
  #clock = new FixClock();
  /** @type {{coords: Coords, stamp_ms: number, age_ms: number} | null} */
  #newest = null;
  /** When the newest fix came; before there is one, when the first was requested. */
  #heard_ms = -Infinity;
  #isNew = false;
  /** @type {Why | null} what stands until a fix comes */
  #failure = null;
  #sent_ms = -Infinity;
  /** @type {Why | null} */
  #sentWhy = null;
  isHidden = false;

  /** Positions are requested from now on. @param {number} now_ms */
  begin(now_ms) {
    this.#heard_ms = now_ms;
    this.#failure = null;
    this.#newest = null;
  }

  /** @param {Coords} coords @param {number} stamp_ms @param {number} now_ms @param {number} wall_ms */
  fix(coords, stamp_ms, now_ms, wall_ms) {
    if (this.#newest?.stamp_ms === stamp_ms) return; // the same again: it is no younger for that
    this.#newest = { coords, stamp_ms, age_ms: this.#clock.note(stamp_ms, wall_ms) };
    this.#heard_ms = now_ms;
    this.#isNew = true;
    this.#failure = null;
  }

  /** The browser gave a reason instead of a position. @param {Why} why */
  fail(why) {
    this.#failure = why;
  }

  /** How long no fix has come [ms]. @param {number} now_ms */
  silence_ms(now_ms) {
    return now_ms - this.#heard_ms;
  }

  /** Why there is no position now, or null. @param {number} now_ms @returns {Why | null} */
  why(now_ms) {
    if (this.#failure === 'denied' || this.#failure === 'insecure') return this.#failure;
    if (this.isHidden) return 'hidden';
    if (this.#newest && this.silence_ms(now_ms) <= NO_FIX_MS) return null;
    return this.#failure ?? 'timeout';
  }

  /** What is to be sent now, or null. @param {number} now_ms @returns {PositionReport | null} */
  due(now_ms) {
    const why = this.why(now_ms);
    if (why) return why !== this.#sentWhy || now_ms - this.#sent_ms >= WHY_EVERY_MS ? { why } : null;
    if (!this.#newest || !this.#isNew || (!this.#sentWhy && now_ms - this.#sent_ms < FIX_EVERY_MS)) return null;
    const { coords, stamp_ms, age_ms } = this.#newest;
    return {
      fix: {
        lat_deg: coords.latitude,
        lon_deg: coords.longitude,
        accuracy_m: coords.accuracy,
        alt_m: known(coords.altitude),
        speed_mps: known(coords.speed),
        heading_deg: known(coords.heading),
        at_ms: stamp_ms,
        age_s: (age_ms + this.silence_ms(now_ms)) / 1000,
      },
    };
  }

  /** It went out. @param {PositionReport} report @param {number} now_ms */
  sent(report, now_ms) {
    this.#sent_ms = now_ms;
    this.#sentWhy = 'why' in report ? report.why : null;
    if ('fix' in report) this.#isNew = false;
  }

  /** Nothing was sent yet: another connection. */
  forget() {
    this.#sent_ms = -Infinity;
    this.#sentWhy = null;
  }
}

/**
 * The reason in a GeolocationPositionError.
 * @param {number} code
 * @returns {Why}
 */
export function whyOf(code) {
  return code === 1 ? 'denied' : code === 3 ? 'timeout' : 'unavailable';
}
