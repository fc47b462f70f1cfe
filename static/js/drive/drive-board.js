// A board that Back closes: of the logbook, and of two drives compared. While a car is monitored it lies in the view, as the screens
// behind the menu do: strip and rail stay, and so does every dialog. Else it lies over the pages.

import { field, html, icon, listen, need, setAttribute } from '../core/dom.js';
import { mountHeadSpeed } from '../shell/head-speed.js';
import { mustWait } from '../shell/sheet.js';

/**
 * @param {object} what
 * @param {string} what.kind its class
 * @param {string} what.label
 * @param {HTMLElement} what.title
 * @param {HTMLElement[]} what.ends beside the title
 * @param {HTMLElement} what.view
 * @param {import('../core/store.js').Store} what.store
 * @param {() => void} what.onClose
 */
export function openBoard({ kind, label, title, ends, view, store, onClose }) {
  const monitor = need(document, '#monitor');
  const isInView = !monitor.hidden;
  const others = /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll(isInView ? '.drive-board' : 'body > .board')); // no dialog, no notice: what waits for an answer can be answered
  const beneath = [...others].filter((one) => !one.inert);
  const back = html('button', { type: 'button', class: 'btn', 'aria-label': 'Back', 'data-f': `${kind}-back` }, icon('back'));
  const bar = html('div', { class: 'titlebar' }, back, title, ...ends);
  const board = html('div', { class: `${isInView ? 'screen' : 'board'} drive-board ${kind}-board`, role: 'dialog', 'aria-modal': isInView ? null : 'true', 'aria-label': label }, bar, view);
  const focused = document.activeElement;
  const front = frontOf(monitor);
  for (const one of beneath) setAttribute(one, 'inert', true);
  (isInView ? need(monitor, '.view') : document.body).append(board);
  const opened = Date.now(); // an older entry is of a board that was closed in another way
  history.pushState({ [kind]: opened }, '');
  const close = () => {
    stops.forEach((stop) => stop());
    onClose();
    board.remove();
    for (const one of beneath) setAttribute(one, 'inert', null);
    if (focused instanceof HTMLElement) focused.focus({ preventScroll: true });
  };
  const stops = [
    ...(isInView ? [mountHeadSpeed(bar, store)] : []),
    listen(back, 'click', () => history.back()),
    listen(window, 'popstate', (event) => {
      if (board.inert || history.state?.[kind] === opened) return; // another board lies over it, or a sheet did
      event.stopImmediatePropagation(); // what lies beneath stays
      close();
    }, { capture: true }),
    listen(board, 'keydown', (event) => {
      if (event.key === 'Escape') history.back();
    }),
    store.on('draw', () => {
      if (mustWait() || frontOf(monitor) !== front) close(); // something waits for an answer, or another page, tab or screen was opened
    }),
  ];
  title.focus();
}

/** What is in front of all: the page, its tab, and whether a screen lies over it. @param {HTMLElement} monitor */
const frontOf = (monitor) => [document.body.dataset['screen'], monitor.dataset['front'], field(monitor, 'screen').hidden].join();

/** One figure of a row. @param {string} name @param {string | null} value null: not known @param {string} unit @param {string} more @param {boolean} [isBad] */
export function figure(name, value, unit, more, isBad = false) {
  const head = html('dt', {}, name, ...(isBad ? [icon('warn', 's c-warn')] : []));
  const shown = value === null ? html('b', { class: 'unknown' }, 'not known') : html('b', { class: 'n' }, value);
  return html('div', {}, head, html('dd', {}, shown, ...(value !== null && unit ? [html('span', { class: 'u' }, unit)] : [])), html('dd', { class: 'sub' }, more));
}

/** @param {number} at_ms */
export const dayOf = (at_ms) => new Date(at_ms).toLocaleString('en-GB', { day: 'numeric', month: 'short', hour: '2-digit', minute: '2-digit' });

/** @param {string} label @param {[string, string][]} [choices] @param {string} [value] */
export function select(label, choices = [], value = '') {
  const element = /** @type {HTMLSelectElement} */ (html('select', { 'aria-label': label }));
  options(element, choices, value);
  return element;
}

/** @param {HTMLSelectElement} element @param {[string, string][]} choices @param {string} value */
export function options(element, choices, value) {
  element.replaceChildren(...choices.map(([one, name]) => html('option', { value: one }, name)));
  element.value = value;
}
