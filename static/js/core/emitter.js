// Who listens to what; a listener that throws stops none of the others.

/** @template {string} Topic */
export class Emitter {
  /** @type {Map<Topic, Set<(detail?: any) => void>>} */
  #listeners = new Map();
  #failed;

  /** @param {(error: unknown) => void} failed gets what a listener throws */
  constructor(failed) {
    this.#failed = failed;
  }

  /**
   * Listen; the result stops listening.
   * @param {Topic} topic
   * @param {(detail?: any) => void} listener
   */
  on(topic, listener) {
    const all = this.#listeners.get(topic) ?? new Set();
    this.#listeners.set(topic, all);
    all.add(listener);
    return () => void all.delete(listener);
  }

  /**
   * @param {Topic} topic
   * @param {any} [detail]
   */
  emit(topic, detail) {
    for (const listener of this.#listeners.get(topic) ?? []) this.guard(() => listener(detail)); // one broken panel must not stop the veil, the sound or the other panels
  }

  /** Act; what it throws is a failure. @param {() => void} act */
  guard(act) {
    try {
      act();
    } catch (error) {
      this.#failed(error);
    }
  }

  clear() {
    this.#listeners.clear();
  }
}
