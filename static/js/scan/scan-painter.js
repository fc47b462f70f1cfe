// Draws the scan in a thread of its own: it is half of the work of the tab, and the page's thread has fingers to answer.
// scan-glass.js is the page's side: it sends what to draw, and requests the next picture when one is drawn.

import { ScanPlot } from './scan-plot.js';

/**
 * @typedef {import('./scan-plot.js').Picture} Picture
 * @typedef {{family: string, weight: string, bytes: ArrayBuffer}} Font
 * @typedef {{canvas?: OffscreenCanvas, fonts?: Font[], picture?: Picture}} Order one of them
 */

const page = /** @type {{onmessage: (event: MessageEvent<Order>) => void, postMessage(done: 'drawn'): void, fonts?: FontFaceSet}} */ (
  /** @type {unknown} */ (self)
);
/** @type {ScanPlot | null} */
let plot = null;
/** @type {Picture | null} */
let newest = null;

page.onmessage = ({ data: { canvas, fonts, picture } }) => {
  if (canvas) plot = new ScanPlot(canvas);
  if (fonts) load(fonts);
  if (!picture) return;
  newest = picture;
  plot?.draw(picture);
  page.postMessage('drawn');
};

/** A thread has fonts of its own. @param {Font[]} fonts */
async function load(fonts) {
  const faces = fonts.map(({ family, weight, bytes }) => new FontFace(family, bytes, { weight }));
  await Promise.allSettled(faces.map((face) => face.load()));
  for (const face of faces) if (face.status === 'loaded') page.fonts?.add(face);
  if (newest) plot?.draw(newest);
}
