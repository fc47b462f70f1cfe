// Shelving: by name, for a while, never longer than 15 minutes.

import { closeSheet, openSheet } from '../shell/sheet.js';
import { field, need, setSentence } from '../core/dom.js';

/**
 * @param {import('../core/store.js').Store} store
 * @param {import('../core/protocol-types.js').StandingAlarm} alarm
 * @param {(sentence: string, title?: string) => void} say
 */
export function openShelve(store, alarm, say) {
  const sheet = /** @type {HTMLDialogElement} */ (need(document, '#sheet-shelve'));
  setSentence(field(sheet, 'words'), `“${alarm.title}” is not announced meanwhile. Shelving ends by itself.`);
  for (const key of /** @type {NodeListOf<HTMLElement>} */ (sheet.querySelectorAll('[data-minutes]'))) {
    key.onclick = async () => {
      closeSheet(sheet);
      const answer = await store.ask('shelve', { alarm: alarm.id, occurrence: alarm.occurrence, minutes: Number(key.dataset['minutes']) });
      if (!answer.ok) say(answer.reason ?? 'Refused.', 'Not shelved');
    };
  }
  openSheet(sheet);
}
