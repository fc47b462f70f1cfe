// Reads back what was written: a browser whose functions do nothing, or the wrong thing, draws nothing although nothing throws.

import { html, setAttribute, setText, setSentence } from './dom.js';
import { fixed } from './format.js';

export class DrawProof {
  #n = 0;
  #text = html('span');
  #sentence = html('span');

  /** Does writing have an effect, into what is there and anew? */
  isDrawn() {
    this.#n = (this.#n + 1) % 10;
    return this.#isWritten(this.#text, this.#sentence) && this.#isWritten(html('span'), html('span'));
  }

  /** @param {Element} text @param {Element} sentence */
  #isWritten(text, sentence) {
    const [now, speed] = [`proof ${this.#n}`, fixed(this.#n + 0.25)];
    setText(text, now);
    setAttribute(text, 'data-n', this.#n);
    setSentence(sentence, `at ${speed} m`);
    const quantity = sentence.childNodes[1];
    return textOf(text) === now && text.attributes[0]?.value === String(this.#n) && speed.length === 3 && textOf(sentence) === 'at ' && textOf(quantity?.firstChild) === speed && textOf(quantity?.childNodes[1]) === ' m';
  }
}

/** By another road than it was written. @param {Node | null | undefined} node */
function textOf(node) {
  const first = node?.firstChild;
  return first ? /** @type {Text} */ (first).data : /** @type {Text | undefined} */ (node)?.data;
}

/**
 * To be called after each complete drawing: restarts the delay of 2 s after which CSS covers the page, where a fresh frame was drawn.
 * `data-states` at the root is the number of fresh frames that were drawn: by it others see that a frame has reached the glass.
 * Throws where nothing was written.
 * @param {{painter: import('./painter.js').Painter, deadMan: import('./dead-man.js').DeadMan}} page
 * @param {() => object | null} newest the frame that was drawn
 */
export function rewinder({ painter, deadMan }, newest) {
  const proof = new DrawProof();
  let drawn = 0;
  let states = 0;
  /** @type {object | null} */
  let seen = null;
  return () => {
    if (!proof.isDrawn()) {
      painter.drawing.distrust();
      throw new Error('What was written is not there');
    }
    drawn = 1 - drawn;
    const { dataset } = document.documentElement;
    dataset['drawn'] = String(drawn);
    if (dataset['drawn'] !== String(drawn)) throw new Error('The covers are not rewound');
    const frame = newest();
    if (deadMan.covered || frame === seen) return;
    seen = frame;
    states += 1;
    dataset['states'] = String(states);
    dataset['beat'] = String(states % 2); // of its own: where every second drawing has a fresh frame, the one above would not turn over
  };
}
