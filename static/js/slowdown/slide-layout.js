// The slide as a gesture, without a page: what begins it, what carries it, what makes it an order and what never does.

/** So much of the way, and then let go, is an order; short of it the knob springs back. */
export const FAR_ENOUGH = 0.8;
/** From the keyboard: Enter, held for so long [ms]. */
export const HOLD_MS = 1000;
/** Of the design: how wide the knob is, and how far beside it a thumb may still begin [px]. */
export const KNOB_PX = 60;
const BESIDE_PX = 16;
/** A finger that moved less was a tap. */
const TAP = 0.06;

/**
 * @typedef {'rest' | 'drag' | 'hold' | 'barred'} Phase barred: nothing counts until this touch is over
 * @typedef {'order' | 'short' | 'tap' | null} Outcome short: let go too early
 */

export class Slide {
  /** Where the knob is, 0…1 of its way. */
  share = 0;
  /** @type {Phase} */
  phase = 'rest';
  #pointer = -1;
  #from_px = 0;
  #way_px = 1;
  #since_ms = 0;

  /**
   * A finger or a mouse came down on the slide.
   * @param {number} pointer which
   * @param {number} at_px from the end where the knob rests, along its way
   * @param {number} way_px how far the knob can go
   */
  down(pointer, at_px, way_px) {
    if (this.phase !== 'rest') return this.bar();
    this.#pointer = pointer;
    this.#from_px = at_px;
    this.#way_px = Math.max(1, way_px);
    // A tap beside the knob, and whatever lies flat upon the whole of it, begins nothing.
    this.phase = at_px >= -BESIDE_PX && at_px <= KNOB_PX + BESIDE_PX ? 'drag' : 'barred';
  }

  /** @param {number} pointer @param {number} at_px */
  move(pointer, at_px) {
    if (this.phase !== 'drag' || pointer !== this.#pointer) return;
    this.share = Math.min(1, Math.max(0, (at_px - this.#from_px) / this.#way_px));
  }

  /**
   * A pointer went up: the slide's own ends the gesture.
   * @param {number} pointer
   * @returns {Outcome}
   */
  up(pointer) {
    if (pointer !== this.#pointer || this.phase === 'hold') return null;
    const { phase, share } = this;
    this.rest();
    if (phase === 'barred') return share < TAP ? 'tap' : 'short';
    if (phase !== 'drag') return null;
    if (share >= FAR_ENOUGH) return 'order';
    return share < TAP ? 'tap' : 'short';
  }

  /** Another finger came down anywhere, or another key: a hand holds one thing on purpose, a pocket presses many. */
  bar() {
    if (this.phase === 'rest') return;
    this.phase = 'barred';
    this.share = 0;
  }

  /** The browser took the gesture away, or the slide is none any more. */
  rest() {
    this.phase = 'rest';
    this.share = 0;
    this.#pointer = -1;
  }

  /** @param {string} key @param {boolean} isRepeated by the keyboard itself @param {number} now_ms */
  press(key, isRepeated, now_ms) {
    if (isRepeated) return;
    if (key !== 'Enter' && key !== ' ') return this.bar();
    if (this.phase !== 'rest') return this.bar();
    this.phase = 'hold';
    this.#since_ms = now_ms;
  }

  /**
   * Time passed while a key is held.
   * @param {number} now_ms
   * @returns {Outcome}
   */
  look(now_ms) {
    if (this.phase !== 'hold') return null;
    this.share = Math.min(1, (now_ms - this.#since_ms) / HOLD_MS);
    if (this.share < 1) return null;
    this.phase = 'barred'; // the key is still down: it must come up before it counts again
    this.share = 0;
    return 'order';
  }

  /** Any key came up. @returns {Outcome} */
  release() {
    const was = this.phase;
    if (this.#pointer !== -1) return null;
    this.rest();
    return was === 'hold' ? 'short' : null;
  }
}
