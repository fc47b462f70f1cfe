// Whether a press was meant for what stands there: nobody reads what has just come or moved, and presses it.

/** So long after it came or moved a key takes no press [ms]. */
const MEANT_MS = 400;
/** An event's own time is not trusted beyond so much [ms]. */
const OLDEST_MS = 10_000;

/** When a finger or a key did it, by `performance.now()`: a busy page gets it later. @param {Event} event */
export function cameAt({ timeStamp }) {
  const now_ms = performance.now();
  return timeStamp > now_ms - OLDEST_MS && timeStamp <= now_ms ? timeStamp : now_ms;
}

/** When the newest finger came down, by `performance.now()`. */
let down_ms = -Infinity;
globalThis.addEventListener?.('pointerdown', (event) => { down_ms = cameAt(event); }, { capture: true });

/** When the press of a click began: a finger may have come down on what stood there before. @param {Event} event */
function beganAt(event) {
  const at_ms = cameAt(event);
  const isByFinger = event.isTrusted && event instanceof MouseEvent && event.detail > 0 && at_ms - down_ms < OLDEST_MS; // help for the blind clicks without one
  return isByFinger ? Math.min(down_ms, at_ms) : at_ms;
}

export class Meant {
  #since_ms = -Infinity;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #timer;

  /** @param {HTMLElement | null} [element] in which no key is to be pressed meanwhile, while it has `data-moved` */
  constructor(element = null) {
    this.element = element;
  }

  /** What stands there came, moved or is another. */
  moved() {
    this.#since_ms = performance.now();
    if (!this.element) return;
    this.element.dataset['moved'] = '';
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.stop(), MEANT_MS);
  }

  /** @param {Event} event */
  by(event) {
    return beganAt(event) - this.#since_ms >= MEANT_MS;
  }

  stop() {
    clearTimeout(this.#timer);
    if (this.element) delete this.element.dataset['moved'];
  }
}
