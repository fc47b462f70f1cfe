// Reads back what was written: a browser whose functions do nothing, or the wrong thing, draws nothing although nothing throws.

import { html, setAttribute, setText, setWords } from './dom.js';
import { fixed } from './format.js';

export class DrawProof {
  #n = 0;
  #text = html('span');
  #words = html('span');

  /** Does writing have an effect? */
  isDrawn() {
    this.#n = (this.#n + 1) % 10;
    const [now, speed] = [`proof ${this.#n}`, fixed(this.#n + 0.25)];
    setText(this.#text, now);
    setAttribute(this.#text, 'data-n', this.#n);
    setWords(this.#words, `at ${speed} m`);
    const [text, words] = [this.#text, this.#words];
    return textOf(text) === now && text.attributes[0]?.value === String(this.#n) && speed.length === 3 && textOf(words) === 'at ' && textOf(words.childNodes[1]) === speed;
  }
}

/** By another road than it was written. @param {Node | undefined} node */
function textOf(node) {
  const first = node?.firstChild;
  return first ? /** @type {Text} */ (first).data : /** @type {Text | undefined} */ (node)?.data;
}
