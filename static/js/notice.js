// A word of the page itself: something was refused, a blind time is over. It goes by itself, and takes no place of an alarm.

import { html, icon, words } from './dom.js';

const STAYS_MS = 8000;

/**
 * @param {HTMLElement} root where snackbars stand
 * @returns {(sentence: string, title?: string) => void}
 */
export function notices(root) {
  return (sentence, title = '') => {
    const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close' }, icon('close'));
    const text = html('div', { class: 'tx' }, ...(title ? [html('b', {}, ...words(title))] : []), html('span', {}, ...words(sentence)));
    const note = html('div', { class: 'snack note', role: 'status' }, html('div', { class: 'side' }, icon('info')), text, close);
    const take = () => note.remove();
    close.addEventListener('click', take);
    setTimeout(take, STAYS_MS);
    for (const old of root.querySelectorAll('.note')) old.remove();
    root.append(note);
  };
}
