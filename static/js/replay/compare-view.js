// Which part of the time line of two recordings their charts show.

import { LEAST_S, viewAfter } from '../home/drive-layout.js';

/** @typedef {[number, number]} View from and to [s] */

/** Where the moment is in a view that goes on with it, by its width. */
const LEAD = 0.1;

export class CompareView {
  /** null: all of it. @type {View | null} */
  #part = null;

  /** @param {View} union of both recordings @returns {View} */
  view([from_s, to_s]) {
    return this.#part ?? [from_s, Math.max(to_s, from_s + LEAST_S)];
  }

  /** Its width [s]; infinite: all. */
  get width_s() {
    return this.#part ? Math.round((this.#part[1] - this.#part[0]) * 100) / 100 : Infinity;
  }

  /** A part about a moment. @param {number} width_s @param {number} at_s @param {View} union */
  show(width_s, at_s, union) {
    if (width_s === Infinity) this.#part = null;
    else this.#set([at_s - width_s / 2, at_s + width_s / 2], {}, union);
  }

  /** @param {import('../home/drive-gestures.js').Change} change @param {View} union */
  change(change, union) {
    this.#set(this.view(union), change, union);
  }

  /** Goes on with a moment that leaves it. @param {number} at_s @param {View} union */
  keepUp(at_s, union) {
    if (!this.#part || (at_s >= this.#part[0] && at_s <= this.#part[1])) return;
    const width_s = this.#part[1] - this.#part[0];
    this.#set([at_s - width_s * LEAD, at_s + width_s * (1 - LEAD)], {}, union);
  }

  /** @param {View} view @param {import('../home/drive-gestures.js').Change} change @param {View} union */
  #set([from_s, to_s], change, [begin_s, end_s]) {
    const [a, b] = viewAfter([from_s - begin_s, to_s - begin_s], change, end_s - begin_s);
    this.#part = b - a >= end_s - begin_s - 0.01 ? null : [a + begin_s, b + begin_s];
  }
}
