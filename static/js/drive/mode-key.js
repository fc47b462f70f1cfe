// The left of the ledge: who drives. Where an intervention waits for its description it is a key that opens the form.

import { html, icon, listen, setAttribute, setText, show, svg } from '../core/dom.js';
import { SHAPES, modeWords } from './mode-text.js';

/** @typedef {import('../core/store.js').Store} Store */
/** @typedef {(sentence: string, title?: string) => void} Say */

const GONE = 'This part of the page could not be loaded from the server. The intervention is stored; it can be described later.';

/**
 * @param {HTMLElement} place
 * @param {Store} store
 * @param {Say} say
 * @returns {() => void}
 */
export function mountMode(place, store, say) {
  const label = html('div', { class: 'mode', 'data-f': 'mode-label' });
  const key = html('button', { type: 'button', class: 'mode', 'data-f': 'mode-key', 'data-operator': '' });
  const faces = [new Face(label), new Face(key)];
  key.append(icon('next'));
  /** @type {string | null} */
  let open = null;
  const draw = () => {
    const { frame } = store;
    const isLinked = frame !== null && !store.isSilent && frame.session.phase === 'monitoring';
    const shown = modeWords(frame?.mode, frame?.server.time_ms ?? 0, isLinked);
    open = shown.open;
    for (const face of faces) face.draw(shown);
    show(label, open === null);
    show(key, open !== null);
  };
  draw();
  place.replaceChildren(label, key, html('span', { class: 'cover' })); // which is seen once nothing is drawn any more
  const stops = [
    store.on('draw', draw),
    listen(key, 'click', () => {
      const id = open;
      if (id !== null) import('./take-over.js').then(({ openTakeOver }) => openTakeOver(id, store, say)).catch(() => say(GONE, 'Not opened'));
    }),
  ];
  return () => {
    stops.forEach((stop) => stop());
    place.replaceChildren();
  };
}

/** Icon and words of the mode, in a label or in a key. */
class Face {
  #path = svg('path');
  #known = /** @type {any} */ (svg('svg', { class: 'i', viewBox: '0 0 24 24', 'aria-hidden': 'true' }, this.#path));
  #unknown = icon('unknown', 'dashed');
  #title = html('b');
  #text = html('small');

  /** @param {HTMLElement} element */
  constructor(element) {
    this.element = element;
    element.append(this.#known, this.#unknown, html('span', {}, this.#title, this.#text));
  }

  /** @param {import('./mode-text.js').Shown} shown */
  draw({ mode, title, text }) {
    setAttribute(this.element, 'data-mode', mode);
    show(this.#known, mode !== 'unknown');
    show(this.#unknown, mode === 'unknown');
    if (mode !== 'unknown') setAttribute(this.#path, 'd', SHAPES[mode]);
    setText(this.#title, title);
    setText(this.#text, text);
  }
}
