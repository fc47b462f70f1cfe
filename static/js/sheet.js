// Opens and closes the sheets the operator asked for. Alarms take precedence: see dialogs.js.

import { field, listen, need } from './dom.js';

/** @param {HTMLDialogElement} sheet */
export function openSheet(sheet) {
  for (const other of /** @type {NodeListOf<HTMLDialogElement>} */ (document.querySelectorAll('dialog[open]'))) {
    if (other !== sheet && isAsked(other)) other.close();
  }
  if (!sheet.open) sheet.showModal();
}

/** @param {HTMLDialogElement} sheet */
export function closeSheet(sheet) {
  if (sheet.open) sheet.close();
}

/** Sheets opened by the operator, which give way to an alarm. */
const ASKED = ['sheet-menu', 'sheet-history', 'sheet-shelve', 'sheet-stop', 'sheet-preferences', 'sheet-topic', 'sheet-profile', 'sheet-reset', 'sheet-chart'];

/** @param {HTMLDialogElement} sheet */
export function isAsked(sheet) {
  return ASKED.includes(sheet.id);
}

/** Each closes by its own key, by Escape or back (the browser's doing), and by a press outside of it. */
export function mountSheets() {
  const sheets = ASKED.map((id) => /** @type {HTMLDialogElement} */ (need(document, `#${id}`)));
  const stops = sheets.flatMap((sheet) => [
    listen(field(sheet, 'no'), 'click', () => sheet.close()),
    listen(sheet, 'click', (event) => {
      if (event.target === sheet && event.clientY < sheet.getBoundingClientRect().top) sheet.close();
    }),
  ]);
  return () => stops.forEach((stop) => stop());
}
