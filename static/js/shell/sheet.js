// Opens and closes the sheets the operator asked for. Alarms take precedence: see dialogs.js.

import { field, listen, need } from '../core/dom.js';

/** @param {HTMLDialogElement} sheet */
export function openSheet(sheet) {
  for (const other of /** @type {NodeListOf<HTMLDialogElement>} */ (document.querySelectorAll('dialog[open]'))) {
    if (other !== sheet && isAsked(other)) other.close();
  }
  if (!sheet.open) sheet.showModal();
}

/** Whether a dialog stands over the page that no sheet may cover: an alarm, a broken link. */
export function mustWait() {
  return [.../** @type {NodeListOf<HTMLDialogElement>} */ (document.querySelectorAll('dialog:modal'))].some((one) => !isAsked(one));
}

/** @param {HTMLDialogElement} sheet */
export function closeSheet(sheet) {
  if (sheet.open) sheet.close();
}

/** Sheets opened by the operator, which give way to an alarm. */
const ASKED = ['sheet-menu', 'sheet-history', 'sheet-shelve', 'sheet-stop', 'sheet-preferences', 'sheet-topic', 'sheet-profile', 'sheet-reset'];

/** @param {HTMLDialogElement} sheet */
export function isAsked(sheet) {
  return (sheet.dataset['asked'] !== undefined || ASKED.includes(sheet.id)) && sheet.dataset['docked'] === undefined; // what is docked covers nothing
}

export function mountSheets() {
  const stops = ASKED.map((id) => mountSheet(/** @type {HTMLDialogElement} */ (need(document, `#${id}`))));
  return () => stops.forEach((stop) => stop());
}

/**
 * A sheet that was made when it was first wanted, with a key `data-f="no"` that closes it.
 * @param {HTMLDialogElement} sheet
 * @returns {() => void} takes it away again
 */
export function addSheet(sheet) {
  sheet.dataset['asked'] = '';
  document.body.append(sheet);
  const stop = mountSheet(sheet);
  return () => {
    stop();
    sheet.remove();
  };
}

/**
 * It closes by its own key, by Escape or back (the browser's doing), and by a press outside of it.
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
