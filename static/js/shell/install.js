// "Install" in the menu: the browser's own offer where it has one, on an iPhone the words how, else nothing.

import { field, html, listen, need, show, words } from '../core/dom.js';
import { addSheet, closeSheet, openSheet } from './sheet.js';

/** @typedef {Event & {prompt(): Promise<{outcome: string}>}} Offer https://wicg.github.io/manifest-incubations/#beforeinstallpromptevent-interface */

/**
 * Which way of installing there is.
 * @param {{agent: string, touchPoints: number, isInstalled: boolean, hasOffer: boolean}} phone
 * @returns {'offer' | 'apple' | null}
 */
export function wayToInstall({ agent, touchPoints, isInstalled, hasOffer }) {
  if (isInstalled) return null;
  if (hasOffer) return 'offer';
  const isApple = /\b(iPhone|iPad|iPod)\b/.test(agent) || (/\bMacintosh\b/.test(agent) && touchPoints > 1); // an iPad calls itself a Mac
  return isApple ? 'apple' : null;
}

/** @param {(sentence: string, title?: string) => void} say */
export function mount(say) {
  const menu = /** @type {HTMLDialogElement} */ (need(document, '#sheet-menu'));
  const key = field(menu, 'install');
  /** @type {Offer | null} */
  let offer = null;
  /** @type {HTMLDialogElement | null} */
  let sheet = null;
  let isInstalled = matchMedia('(display-mode: standalone)').matches || /** @type {{standalone?: boolean}} */ (navigator).standalone === true;

  const way = () => wayToInstall({ agent: navigator.userAgent, touchPoints: navigator.maxTouchPoints, isInstalled, hasOffer: offer !== null });
  const draw = () => show(key, way() !== null);

  async function install() {
    closeSheet(menu);
    if (way() === 'apple') {
      if (!sheet) addSheet((sheet = appleSheet()));
      openSheet(sheet);
      return;
    }
    const asked = offer;
    offer = null; // it can be asked once
    draw();
    const { outcome } = (await asked?.prompt().catch(() => null)) ?? { outcome: 'failed' };
    if (outcome === 'failed') say('The browser showed no prompt. Its menu may offer “Install” too.', 'Not installed');
  }

  draw();
  const stops = [
    listen(window, 'beforeinstallprompt', (event) => {
      event.preventDefault(); // it asks when the operator wants it, not over the instruments
      offer = /** @type {Offer} */ (event);
      draw();
    }),
    listen(window, 'appinstalled', () => {
      isInstalled = true;
      offer = null;
      draw();
    }),
    listen(key, 'click', install),
  ];
  return () => stops.forEach((stop) => stop());
}

function appleSheet() {
  const step = (/** @type {string} */ sentence) => html('li', {}, ...words(sentence));
  return /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-install', 'aria-labelledby': 'install-title' },
    html('div', { class: 'bd' }, html('h2', { id: 'install-title' }, 'Install on this phone'),
      html('ol', { class: 'steps' }, step('Press Share: the square with the arrow.'), step('Choose “Add to Home Screen”.'), step('Press Add.')),
      html('p', { class: 'sub' }, 'In Safari, and in other browsers that offer it. The installed page is separate: it may ask again for the position and for pairing.')),
    html('div', { class: 'keys' }, html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close'))));
}
