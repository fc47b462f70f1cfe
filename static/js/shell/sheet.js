// Opens and closes the sheets the operator opened. Alarms take precedence: see dialogs.js.

import { field, listen, need, setAttribute } from '../core/dom.js';
import { styled } from '../core/style-sheet.js';
import { isFloor } from './layout.js';

/**
 * While a car is monitored a sheet stands in the view, and nothing else is barred: bar, strip and rail act as before.
 * Where no car is shown it lies over the page.
 * @param {HTMLDialogElement} sheet
 */
export function openSheet(sheet) {
  for (const other of sheetsOpen()) if (other !== sheet && isAsked(other)) other.close();
  if (sheet.open) return;
  const view = document.querySelector('#monitor:not([hidden]) > .view');
  (view ?? document.body).append(sheet);
  if (!view) return sheet.showModal();
  void styled('drawers'); // again where it failed
  sheet.show();
  sheet.scrollTop = 0; // the key that takes the focus does not scroll away what it is about
  setAttribute(need(document, '#monitor'), 'data-sheet', sheet.id);
  sheet.addEventListener('close', () => setAttribute(need(document, '#monitor'), 'data-sheet', openedSheet()?.id), { once: true });
}

/** @returns {NodeListOf<HTMLDialogElement>} */
const sheetsOpen = () => document.querySelectorAll('dialog[open]');

/** The sheet that stands in the view. */
const openedSheet = () => [...sheetsOpen()].find((sheet) => isAsked(sheet) && sheet.closest('.view'));

/** Closes what stands in the view, by hand. */
export const leaveSheet = () => cancel(openedSheet());

/** Whether a dialog stands over the page that no sheet may cover: an alarm, a broken link. */
export function mustWait() {
  return [.../** @type {NodeListOf<HTMLDialogElement>} */ (document.querySelectorAll('dialog:modal'))].some((one) => !isAsked(one));
}

/** By hand, in another way than its own key: who opened it may want to know. @param {HTMLDialogElement} [sheet] */
function cancel(sheet) {
  if (sheet?.dispatchEvent(new Event('cancel', { cancelable: true }))) sheet.close();
}

/** @param {HTMLDialogElement} sheet */
export function closeSheet(sheet) {
  if (sheet.open) sheet.close();
}

/** Sheets opened by the operator, which give way to an alarm. */
const OPENED = ['sheet-menu', 'sheet-history', 'sheet-shelve', 'sheet-stop', 'sheet-preferences', 'sheet-topic', 'sheet-profile', 'sheet-reset'];

/** @param {HTMLDialogElement} sheet */
export function isAsked(sheet) {
  return (sheet.dataset['opened'] !== undefined || OPENED.includes(sheet.id)) && sheet.dataset['docked'] === undefined; // what is docked covers nothing
}

/** Closes what stands in the view when it is left: by Escape, by another tab or screen, by a press beside it where it is no drawer. */
export function mountSheets() {
  const monitor = need(document, '#monitor');
  const seen = new MutationObserver(leaveSheet);
  seen.observe(monitor, { attributeFilter: ['hidden', 'data-front', 'data-over'] });
  const stops = [
    ...OPENED.map((id) => mountSheet(/** @type {HTMLDialogElement} */ (need(document, `#${id}`)))),
    listen(document, 'keydown', (event) => {
      const sheet = event.key === 'Escape' && !document.querySelector('dialog:modal') ? openedSheet() : undefined;
      if (!sheet) return;
      event.stopPropagation(); // it closes nothing else
      cancel(sheet);
    }, { capture: true }),
    listen(need(monitor, '.view'), 'click', (event) => {
      if (isFloor() || !openedSheet() || event.target.closest('dialog')) return;
      event.stopPropagation();
      leaveSheet();
    }, { capture: true }),
    () => seen.disconnect(),
  ];
  return () => stops.forEach((stop) => stop());
}

/**
 * A sheet that was made when it was first wanted, with a key `data-f="no"` that closes it.
 * @param {HTMLDialogElement} sheet
 * @returns {() => void} takes it away again
 */
export function addSheet(sheet) {
  sheet.dataset['opened'] = '';
  document.body.append(sheet);
  const stop = mountSheet(sheet);
  return () => {
    stop();
    sheet.remove();
  };
}

/**
 * It closes by its own key, by Escape or back, and, where it lies over the page, by a press above it.
 * @param {HTMLDialogElement} sheet
 */
function mountSheet(sheet) {
  const stops = [
    listen(field(sheet, 'no'), 'click', () => sheet.close()),
    listen(sheet, 'click', (event) => {
      if (event.target === sheet && event.clientY < sheet.getBoundingClientRect().top) sheet.close();
    }),
  ];
  return () => stops.forEach((stop) => stop());
}
