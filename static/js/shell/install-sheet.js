// How an iPhone installs the page: no browser of it offers to.

import { html, textNodes } from '../core/dom.js';

/** @returns {HTMLDialogElement} */
export function appleSheet() {
  const step = (/** @type {string} */ sentence) => html('li', {}, ...textNodes(sentence));
  return /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-install', 'aria-labelledby': 'install-title' },
    html('div', { class: 'bd' }, html('h2', { id: 'install-title' }, 'Install on this device'),
      html('ol', { class: 'steps' }, step('Press Share: the square with the arrow.'), step('Choose “Add to Home Screen”.'), step('Press Add.')),
      html('p', { class: 'sub' }, 'In Safari, and in other browsers that offer it. The installed page is separate: it may ask again for the position and for pairing.')),
    html('div', { class: 'keys' }, html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close'))));
}
