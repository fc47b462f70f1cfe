// What happens to the page itself: a timer, hidden and shown, asleep with its phone, back on the network.

/**
 * @typedef {object} Watcher
 * @property {() => void} look called at the timer's pace
 * @property {(isBack: boolean, isRestored: boolean) => void} slept hidden, frozen or back; isRestored: from the browser's store of pages
 * @property {() => void} online
 */

export class PageWatch {
  /** @type {(() => void)[]} */
  #stops = [];
  #looked_ms = 0;
  #lookedWall_ms = 0;
  #watcher;

  /** @param {Watcher} watcher */
  constructor(watcher) {
    this.#watcher = watcher;
  }

  /** @param {number} every_ms */
  start(every_ms) {
    this.#looked_ms = performance.now();
    this.#lookedWall_ms = Date.now();
    const timer = setInterval(() => this.#watcher.look(), every_ms);
    this.#stops.push(() => clearInterval(timer));
    for (const type of ['visibilitychange', 'freeze', 'resume']) this.#listen(document, type, () => this.#watcher.slept(type === 'resume' || !document.hidden, false));
    this.#listen(window, 'pageshow', (event) => {
      if (/** @type {PageTransitionEvent} */ (event).persisted) this.#watcher.slept(true, true); // a page that begins is “shown” too
    });
    this.#listen(window, 'online', () => this.#watcher.online());
  }

  stop() {
    for (const stop of this.#stops.splice(0)) stop();
  }

  /**
   * For how long the phone slept since the last call [ms]: its monotonic clock stands still meanwhile, its wall clock does not.
   * @param {number} now_ms monotonic
   */
  slept_ms(now_ms) {
    const slept_ms = Date.now() - this.#lookedWall_ms - (now_ms - this.#looked_ms);
    this.#looked_ms = now_ms;
    this.#lookedWall_ms = Date.now();
    return slept_ms;
  }

  /** @param {EventTarget} target @param {string} type @param {(event: Event) => void} listener */
  #listen(target, type, listener) {
    target.addEventListener(type, listener);
    this.#stops.push(() => target.removeEventListener(type, listener));
  }
}
