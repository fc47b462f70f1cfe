// The camera, or a file: chosen by the person, made smaller, kept with its mark.

import { html } from '../core/dom.js';
import { shrunk } from './photo.js';

/**
 * Lets the user take a picture, and keeps it with a mark.
 * @param {string} id
 * @param {import('./marks.js').Marks} marks
 * @param {import('./marks.js').Say} say
 * @param {() => void} [onDone] it is kept, or none was chosen
 */
export function pickPhoto(id, marks, say, onDone = () => {}) {
  const input = /** @type {HTMLInputElement} */ (html('input', { type: 'file', accept: 'image/*', capture: 'environment', hidden: true, 'data-f': 'mark-file', 'aria-label': 'Photo of the mark' }));
  const end = () => {
    input.remove();
    onDone();
  };
  input.addEventListener('cancel', end);
  input.addEventListener('change', async () => {
    const file = input.files?.[0];
    try {
      if (file) await marks.attach(id, 'photo', await shrunk(file));
    } catch (error) {
      say(error instanceof Error ? error.message : 'This picture could not be read.', 'No photo added');
    } finally {
      end();
    }
  });
  for (const old of document.querySelectorAll('[data-f="mark-file"]')) old.remove();
  document.body.append(input);
  input.click();
}
