// A photo of a mark, small: from this phone as a drawing, from the server as a picture.

import { html, show } from '../core/dom.js';

export class PhotoView {
  /** @type {Blob | string | null} */
  #shown = null;
  element = html('div', { class: 'photo', hidden: true });

  /** @param {() => Blob | string | null} source null: there is no photo */
  constructor(source) {
    this.source = source;
  }

  draw() {
    const source = this.source();
    if (source === this.#shown) return;
    this.#shown = source;
    show(this.element, source !== null);
    if (source === null) this.element.replaceChildren();
    else if (typeof source === 'string') this.element.replaceChildren(html('img', { src: source, alt: 'Photo of the mark', decoding: 'async' }));
    else void this.#paint(source);
  }

  /** @param {Blob} blob */
  async #paint(blob) {
    const picture = await createImageBitmap(blob).catch(() => null);
    if (!picture || this.#shown !== blob) return;
    const canvas = /** @type {HTMLCanvasElement} */ (html('canvas', { width: picture.width, height: picture.height, role: 'img', 'aria-label': 'Photo of the mark' }));
    canvas.getContext('2d')?.drawImage(picture, 0, 0);
    picture.close();
    this.element.replaceChildren(canvas);
  }

  stop() {
    this.#shown = null;
    this.element.replaceChildren();
  }
}
