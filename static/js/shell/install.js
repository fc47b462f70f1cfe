// "Install" in the menu: the browser's own offer where it has one, on an iPhone the instructions, else nothing.

import { field, listen, need, show } from '../core/dom.js';
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
      if (!sheet) {
        const how = await import('./install-sheet.js').catch(() => null);
        if (!how) return say('The server does not answer. Open “Install” again.', 'Not shown');
        if (!sheet) addSheet((sheet = how.appleSheet()));
      }
      return openSheet(sheet);
    }
    const prompt = offer;
    offer = null; // it can be shown once
    draw();
    const { outcome } = (await prompt?.prompt().catch(() => null)) ?? { outcome: 'failed' };
    if (outcome === 'failed') say('The browser showed no prompt. Its menu may offer “Install” too.', 'Not installed');
  }

  draw();
  const stops = [
    listen(window, 'beforeinstallprompt', (event) => {
      event.preventDefault(); // it is shown when the operator wants it, not over the instruments
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
