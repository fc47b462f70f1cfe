// A press acts on what it began on. The page moves beneath a finger: an alarm's strip comes, the note of the sound goes
// with the first touch. A click that lands on another key than the one pressed does nothing.

import { listen, show } from '../core/dom.js';

/** How long after the finger is lifted a browser may take until its click comes. */
const CLICK_WITHIN_MS = 400;
/** A finger that is down for longer was lifted without an event of the browser: the note of the sound must not wait for it. */
const LONGEST_PRESS_MS = 12_000;

const ACTS = 'button, a[href], input, select, textarea, summary, label, [role="slider"]';

/**
 * The key at this place, or null.
 * @param {EventTarget | null} target
 */
const keyAt = (target) => (target instanceof Element ? target.closest(ACTS) : null);

export class Press {
  /** What the last press began on. @type {Element | null} */
  #began = null;
  #down_ms = -Infinity;
  #up_ms = -Infinity;

  /**
   * Any touch lets a browser sound; the first one anywhere arms the alarms again after a reload.
   * @param {HTMLElement} note that the sound is off
   * @param {import('../alarms/alarm-sound.js').AlarmSound} alarmSound
   * @param {() => void} [arm] within a press
   */
  constructor(note, alarmSound, arm = () => alarmSound.arm()) {
    this.note = note;
    this.alarmSound = alarmSound;
    const first = () => alarmSound.isRunning || arm();
    this.stops = [
      listen(document, 'pointerdown', (event) => this.#down(event), { capture: true }),
      ...['pointerup', 'pointercancel'].map((type) => listen(document, type, () => this.#up(), { capture: true })),
      ...['pointerup', 'keydown'].map((type) => listen(document, type, first, { capture: true })),
      listen(document, 'click', (/** @type {MouseEvent} */ event) => this.#click(event), { capture: true }),
    ];
  }

  /** Show whether the sound is off: never while a click may be under way, for it would come down on what moved there. */
  draw() {
    const now_ms = performance.now();
    const isDown = this.#down_ms > this.#up_ms && now_ms - this.#down_ms < LONGEST_PRESS_MS;
    if (isDown || now_ms - this.#up_ms < CLICK_WITHIN_MS) return;
    show(this.note, this.alarmSound.isPossible && !this.alarmSound.isRunning);
  }

  /** @param {Event} event */
  #down({ target }) {
    this.#down_ms = performance.now();
    this.#began = target instanceof Element ? target : null;
  }

  #up() {
    this.#up_ms = performance.now();
  }

  /** @param {MouseEvent} event */
  #click(event) {
    const began = this.#began;
    if (!event.isTrusted || event.detail === 0 || !began?.isConnected) return; // by a key, by a script, or drawn anew meanwhile
    const pressed = keyAt(began);
    const clicked = keyAt(event.target);
    if (clicked === null || clicked === pressed || pressed?.contains(clicked) || clicked.contains(pressed)) return;
    if (pressed instanceof HTMLLabelElement && pressed.control === clicked) return;
    event.preventDefault();
    event.stopImmediatePropagation();
  }

  /** Unmount. */
  stop() {
    for (const stop of this.stops) stop();
  }
}
