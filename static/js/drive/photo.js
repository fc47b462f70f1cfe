// A photo of a mark, made small enough to be sent from the field.

import { fixed } from '../core/format.js';

/** The most points it keeps. */
export const MOST_POINTS = 2_000_000;
/** A larger file is not opened: a phone would run out of memory [bytes]. */
export const MOST_BYTES = 100_000_000;
const QUALITY = 0.82;

export const UNREADABLE = 'This picture could not be read. It may be damaged, too large, or of a kind that this browser does not know.';

/**
 * The size in which a picture is kept.
 * @param {number} width
 * @param {number} height
 * @returns {[number, number]}
 */
export function scaled(width, height) {
  const by = Math.min(1, Math.sqrt(MOST_POINTS / (width * height)));
  return [Math.max(1, Math.floor(width * by)), Math.max(1, Math.floor(height * by))];
}

/** The note of one that was made smaller; '' where it stayed about as it was. @param {number} before @param {number} after bytes */
export function smallerWords(before, after) {
  return before > 1.2 * after ? `photo ${fixed(after / 1e6)} MB, made smaller from ${fixed(before / 1e6)} MB` : '';
}

/**
 * A picture as a JPEG of at most 2 megapixels. Raises an Error with a sentence where it cannot be.
 * @param {File} file
 * @returns {Promise<import('./mark-model.js').Part>}
 */
export async function shrunk(file) {
  if (file.size > MOST_BYTES) throw new Error(`This picture has ${fixed(file.size / 1e6, 0)} MB; at most ${fixed(MOST_BYTES / 1e6, 0)} MB can be opened here.`);
  const picture = await createImageBitmap(file, { imageOrientation: 'from-image' }).catch(() => null);
  if (!picture) throw new Error(UNREADABLE);
  try {
    const [width, height] = scaled(picture.width, picture.height);
    const canvas = Object.assign(document.createElement('canvas'), { width, height });
    canvas.getContext('2d')?.drawImage(picture, 0, 0, width, height);
    const blob = await new Promise((/** @type {(blob: Blob | null) => void} */ resolve) => { canvas.toBlob(resolve, 'image/jpeg', QUALITY); });
    if (!blob) throw new Error(UNREADABLE);
    return { blob, type: 'image/jpeg', bytes: blob.size, length_s: null, note: smallerWords(file.size, blob.size), isOpen: false, isStored: false };
  } finally {
    picture.close();
  }
}
