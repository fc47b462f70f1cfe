// A press on the Mark key: a tap, or held to speak, let go or pulled to the left. Times are arguments; no DOM.

/** A press that lasts so long is held [ms]. */
export const HELD_MS = 400;
/** A finger that moved so far to the left lets the voice go [px]. */
export const PULL_PX = 70;
/** Two taps so close are one: a bouncing switch, a click after its touch [ms]. */
const BOUNCE_MS = 60;

/** @typedef {'tap' | 'hold' | 'keep' | 'pull' | null} Done hold: it is held from now on · keep: let go, what was spoken counts · pull: without voice */

export class Press {
  /** @type {{since_ms: number, x: number} | null} */
  #down = null;
  #isHeld = false;
  #tapped_ms = -Infinity;

  get isDown() {
    return this.#down !== null;
  }

  /** How long the finger is down [ms]. @param {number} now_ms */
  for_ms(now_ms) {
    return this.#down ? now_ms - this.#down.since_ms : 0;
  }

  /** @param {number} now_ms @param {number} x */
  down(now_ms, x) {
    this.#down = { since_ms: now_ms, x };
    this.#isHeld = false;
  }

  /** Time passes. @param {number} now_ms @returns {Done} */
  look(now_ms) {
    if (!this.#down || this.#isHeld || now_ms - this.#down.since_ms < HELD_MS) return null;
    this.#isHeld = true;
    return 'hold';
  }

  /** @param {number} x @returns {Done} */
  move(x) {
    if (!this.#down || !this.#isHeld || this.#down.x - x < PULL_PX) return null;
    this.#down = null;
    return 'pull';
  }

  /** @param {number} now_ms @returns {Done} */
  up(now_ms) {
    const down = this.#down;
    this.#down = null;
    if (!down) return null;
    if (this.#isHeld) return 'keep';
    return this.#tap(now_ms);
  }

  /** The browser took the finger away; what was held counts as far as it came. @returns {Done} */
  cancel() {
    const wasHeld = this.#down !== null && this.#isHeld;
    this.#down = null;
    return wasHeld ? 'keep' : null;
  }

  /** A key of a keyboard, or a click that no finger made. @param {number} now_ms @returns {Done} */
  click(now_ms) {
    return this.#down ? null : this.#tap(now_ms);
  }

  /** @param {number} now_ms @returns {Done} */
  #tap(now_ms) {
    if (now_ms - this.#tapped_ms < BOUNCE_MS) return null;
    this.#tapped_ms = now_ms;
    return 'tap';
  }
}
