// A key that plays a voice note: kept on this phone, or stored at the server.

import { html, icon, setAttribute, setIcon, setText, show } from '../core/dom.js';
import { fixed } from '../core/format.js';

export class PlayKey {
  #audio = /** @type {HTMLAudioElement} */ (html('audio', { preload: 'none' }));
  #url = '';
  #icon = icon('play');
  #label = html('span');
  /** @type {number | null} */
  #length_s = null;
  element = html('button', { type: 'button', class: 'key wide', 'data-f': 'mark-play', hidden: true }, this.#icon, this.#label);

  /** @param {() => Blob | string | null} source null: there is no voice @param {import('./marks.js').Say} say */
  constructor(source, say) {
    this.source = source;
    this.say = say;
    this.element.addEventListener('click', () => void this.#press());
    for (const type of ['ended', 'pause', 'play']) this.#audio.addEventListener(type, () => this.#drawWords());
  }

  /** @param {number | null} length_s */
  draw(length_s) {
    show(this.element, this.source() !== null);
    this.#length_s = length_s;
    this.#drawWords();
  }

  async #press() {
    if (!this.#audio.paused) return this.#audio.pause();
    const source = this.source();
    if (source === null) return;
    this.#release();
    this.#url = typeof source === 'string' ? source : URL.createObjectURL(source);
    this.#audio.src = this.#url;
    try {
      await this.#audio.play();
    } catch {
      this.say('The voice note could not be played by this browser, or the server does not answer.', 'Not played');
    }
  }

  #drawWords() {
    const act = this.#audio.paused ? 'Play' : 'Stop';
    setIcon(this.#icon, this.#audio.paused ? 'play' : 'stop');
    setText(this.#label, this.#length_s === null ? act : `${fixed(this.#length_s)} s`);
    setAttribute(this.element, 'aria-label', `${act} the voice note`);
  }

  #release() {
    if (this.#url.startsWith('blob:')) URL.revokeObjectURL(this.#url);
    this.#url = '';
  }

  stop() {
    this.#audio.pause();
    this.#audio.removeAttribute('src');
    this.#release();
  }
}
