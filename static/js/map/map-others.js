// Draws the other operators' phones on the map, each with its name and its circle of accuracy.

import { setAttribute, svg } from '../core/dom.js';
import { pixelOf, round } from './map-layout.js';

/**
 * @typedef {import('./map-layout.js').View} View
 * @typedef {import('./map-layout.js').Size} Size
 * @typedef {{id: string, place: import('../core/geodesy.js').Place, isLive: boolean, accuracy_m: number | null, label: string}} Other
 * @typedef {{group: SVGElement, around: SVGElement, mark: SVGElement, name: SVGElement}} Drawn
 */

/** A name takes about so much room, and the keys at the right edge [px]. */
const NAME_PX = 240;

export class OtherPhones {
  /** @type {Map<string, Drawn>} */
  #drawn = new Map();

  constructor() {
    this.root = svg('g', { class: 'others' });
  }

  /** @param {Other[]} others @param {View} view @param {Size} size */
  draw(others, view, size) {
    const there = new Set(others.map((one) => one.id));
    for (const [id, { group }] of this.#drawn) {
      if (there.has(id)) continue;
      group.remove();
      this.#drawn.delete(id);
    }
    for (const one of others) this.#place(one, pixelOf(one.place, view, size), view, size);
  }

  /** @param {Other} one @param {import('./map-layout.js').Pixel} at @param {View} view @param {Size} size */
  #place(one, at, view, size) {
    const drawn = this.#drawn.get(one.id) ?? this.#make(one.id);
    const [x, y] = at.map(round);
    setAttribute(drawn.mark, 'transform', `translate(${x} ${y})`);
    setAttribute(drawn.mark, 'data-ink', one.isLive ? 'fresh' : 'stale');
    setAttribute(drawn.around, 'display', one.isLive && one.accuracy_m !== null ? null : 'none');
    setAttribute(drawn.around, 'cx', x);
    setAttribute(drawn.around, 'cy', y);
    setAttribute(drawn.around, 'r', round((one.accuracy_m ?? 0) / view.mpp));
    const isSeen = at[0] > -20 && at[0] < size.width + 20 && at[1] > -20 && at[1] < size.height + 20;
    setAttribute(drawn.name, 'display', isSeen ? null : 'none');
    const isRight = at[0] > size.width - NAME_PX; // beside it: above and below stand the names of car and phone
    setAttribute(drawn.name, 'text-anchor', isRight ? 'end' : 'start');
    setAttribute(drawn.name, 'transform', `translate(${round(at[0] + (isRight ? -14 : 14))} ${round(at[1] + 5)})`);
    if (drawn.name.textContent !== one.label) drawn.name.textContent = one.label;
  }

  /** @param {string} id @returns {Drawn} */
  #make(id) {
    const around = svg('circle', { class: 'phacc' });
    const mark = svg('g', { class: 'phone-mark' }, svg('circle', { class: 'ph', r: 9 }), svg('circle', { class: 'phd', r: 3 }));
    const name = svg('text', { class: 'whose' });
    const drawn = { group: svg('g', { 'data-phone': id }, around, mark, name), around, mark, name };
    this.root.append(drawn.group);
    this.#drawn.set(id, drawn);
    return drawn;
  }
}
