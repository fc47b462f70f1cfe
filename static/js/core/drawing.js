// Whether the page draws: counted in the page's own looks, so that a broken clock cannot hide a page that stopped drawing.

/** So many looks in a row without a completed drawing are a failure: 1 s, five looks a second. */
const LOOKS = 5;
/** So many completed drawings in a row end a failure: one may have succeeded by chance. */
const LIFT_AFTER = 5;
/** Failures within so many drawings of each other, half a minute, are one that comes back: after so many the page must be loaded anew. */
const CALM = 150;
const MOST_FAILURES = 3;

export class Drawing {
  isFailed = false;
  #undrawn = 0;
  #run = 0;
  #failures = 0;
  #isFinal = false;

  /** Something that shows the car or its alarms has failed. */
  failed() {
    if (!this.isFailed) this.#failures = this.#run >= CALM ? 1 : this.#failures + 1;
    this.isFailed = true;
    this.#run = 0;
  }

  /** What seemed to be written was not: nobody knows what of the page is true, until it is loaded again. */
  distrust() {
    this.#isFinal = true;
    this.failed();
  }

  /** Everything was drawn, and nothing has failed since the drawing before. */
  completed() {
    this.#undrawn = 0;
    this.#run += 1;
    if (this.#run >= LIFT_AFTER && !this.#isFinal && this.#failures < MOST_FAILURES) this.isFailed = false;
  }

  /** Time passed. @param {boolean} isSeen a hidden page draws nothing, and is not expected to */
  look(isSeen) {
    this.#undrawn = isSeen ? this.#undrawn + 1 : 0;
    if (this.#undrawn > LOOKS) this.failed();
  }
}
