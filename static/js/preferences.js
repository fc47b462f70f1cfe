// Preferences of this phone: so far the theme. They change nothing on the server.

import { listen, need } from './dom.js';
import { openSheet } from './sheet.js';

const sheet = () => /** @type {HTMLDialogElement} */ (need(document, '#sheet-preferences'));

export function openPreferences() {
  openSheet(sheet());
}

/** @returns {() => void} */
export function mount() {
  const keys = /** @type {HTMLElement[]} */ ([...sheet().querySelectorAll('[data-theme-key]')]);
  const draw = () => {
    const now = document.documentElement.dataset['theme'] ?? 'phone';
    for (const key of keys) key.setAttribute('aria-pressed', String(key.dataset['themeKey'] === now));
  };
  draw();
  const stops = keys.map((key) => listen(key, 'click', () => {
    choose(key.dataset['themeKey'] ?? 'phone');
    draw();
  }));
  return () => stops.forEach((stop) => stop());
}

/** @param {string} theme */
function choose(theme) {
  if (theme === 'phone') delete document.documentElement.dataset['theme'];
  else document.documentElement.dataset['theme'] = theme;
  try {
    localStorage.setItem('catgraph.theme', theme);
  } catch {
    // no storage: it holds until the page is loaded again
  }
  window.dispatchEvent(new Event('catgraph-theme'));
}
