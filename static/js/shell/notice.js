// A notice of the page itself: something was refused, a blind time is over. It closes by itself, and takes no place of an alarm.

import { html, icon, mirror, need, textNodes } from '../core/dom.js';
import { isMaybe } from '../core/outcome.js';

const STAYS_MS = 8000;
const OFFERS_MS = 15_000; // what can be pressed must be found and reached first

/**
 * Tells the style sheets what notices stand on, how much room they need, and what is left of the view, also above an alarm's dialog.
 * @param {HTMLElement} root where notices stand
 */
function makeRoom(root) {
  const view = need(document, '#monitor > .view');
  const alarm = need(document, '#sheet-alarm');
  const { style } = document.documentElement;
  const place = () => {
    const tops = [...document.querySelectorAll('#monitor > :is(.ledge, .rail, .scrub)')].map((one) => one.getBoundingClientRect()).filter(({ height }) => height).map(({ top }) => top);
    const sizes = { dock: Math.ceil(innerHeight - Math.min(innerHeight, ...tops)), snack: root.offsetHeight, view: view.offsetHeight, room: alarm.getBoundingClientRect().top - view.getBoundingClientRect().top };
    for (const [name, size] of Object.entries(sizes)) style.setProperty(`--${name}`, `${size}px`); // read before: what is written in between would cost a style of the whole page each
  };
  const seen = new ResizeObserver(place);
  for (const one of [root, view, alarm, ...document.querySelectorAll('#monitor > :is(.ledge, .rail)')]) seen.observe(one);
}

/** @typedef {{label: string, act: () => void, onClosed?: () => void}} Way what a notice offers, as one key; `onClosed`: it was closed by hand */

/**
 * @param {HTMLElement} root where snackbars stand
 * @returns {(sentence: string, title?: string, way?: Way) => void}
 */
export function notices(root) {
  const isCovering = () => root.querySelector('.snack:not([hidden])') !== null;
  const sheets = [...document.querySelectorAll('.sheet.crit')];
  mirror(root, 'data-beside', () => sheets.some((sheet) => sheet.matches(':modal')), sheets, { attributeFilter: ['open'] });
  mirror(document.body, 'data-snack', isCovering, [root], { childList: true, subtree: true, attributeFilter: ['hidden'] });
  makeRoom(root);
  return (sentence, given = '', way = undefined) => {
    const title = isMaybe(sentence) && !given.includes('Not known') ? 'Not known' : given; // the caller takes it for refused
    const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close' }, icon('close'));
    const text = html('div', { class: 'tx' }, ...(title ? [html('b', {}, ...textNodes(title))] : []), html('span', {}, ...textNodes(sentence)));
    const note = html('div', { class: 'snack note', role: 'status' }, html('div', { class: 'side' }, icon('info')), text, close);
    const take = () => note.remove();
    if (way) {
      const key = html('button', { type: 'button', class: 'key' }, way.label);
      key.addEventListener('click', () => {
        take();
        way.act();
      });
      note.append(html('div', { class: 'ac' }, key));
    }
    close.addEventListener('click', () => {
      take();
      way?.onClosed?.();
    });
    setTimeout(take, way ? OFFERS_MS : STAYS_MS);
    for (const old of root.querySelectorAll('.note')) old.remove();
    root.append(note);
  };
}
