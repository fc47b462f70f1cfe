// What the parts of a drive's work share: their style sheet, their icons, a ring that runs.

import { html, setAttribute, svg } from '../core/dom.js';

/** @typedef {keyof typeof SHAPES} Shape */

const SHAPES = {
  flag: 'M6 21.5V3.5h13l-3.5 4.75L19 13H6',
  mic: 'M12 2.5a3 3 0 0 0-3 3v5.5a3 3 0 0 0 6 0V5.5a3 3 0 0 0-3-3z M5.5 11a6.5 6.5 0 0 0 13 0 M12 17.5v4',
  camera: 'M3 7.5h4l2-3h6l2 3h4V19.5H3z M12 9.5a3.75 3.75 0 1 0 0 7.5 3.75 3.75 0 1 0 0-7.5z',
  wheel: 'M12 3.5a8.5 8.5 0 1 0 0 17 8.5 8.5 0 1 0 0-17z M3.8 11h16.4 M12 11v9.5',
  undo: 'M8.5 5 4 9.5 8.5 14 M4 9.5h9.5a5.5 5.5 0 0 1 0 11H9',
};

/** An icon that the page's own sprite has not: it would delay the start. @param {Shape} name */
export function shape(name) {
  return svg('svg', { class: 'i', viewBox: '0 0 24 24', 'aria-hidden': 'true' }, svg('path', { d: SHAPES[name] }));
}

/** @param {Element} icon @param {Shape} name */
export function setShape(icon, name) {
  setAttribute(/** @type {Element} */ (icon.firstElementChild), 'd', SHAPES[name]);
}

const RADIUS = 31;
const ROUND = 2 * Math.PI * RADIUS;

/** A ring of 72 px with something in its middle. */
export class Ring {
  #on = svg('circle', { class: 'on', cx: 36, cy: 36, r: RADIUS, transform: 'rotate(-90 36 36)', 'stroke-dasharray': `0 ${ROUND}` });
  #text = svg('text', { x: 36, y: 45 });
  element = svg('svg', { class: 'ring', viewBox: '0 0 72 72', 'aria-hidden': 'true' }, svg('circle', { class: 'tr', cx: 36, cy: 36, r: RADIUS }), this.#on, this.#text);

  /** @param {number} part 0 … 1 of it is drawn @param {string} text */
  draw(part, text) {
    setAttribute(this.#on, 'stroke-dasharray', `${(Math.min(1, Math.max(0, part)) * ROUND).toFixed(1)} ${ROUND.toFixed(1)}`);
    if (this.#text.textContent !== text) this.#text.textContent = text;
  }
}
