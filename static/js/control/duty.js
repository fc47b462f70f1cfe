// The entry of the menu that opens who is on duty at this device, and a hand-over: both are fetched then.

import { dutyWords } from './duty-layout.js';
import { field, listen, need, setText } from '../core/dom.js';
import { closeSheet, mustWait } from '../shell/sheet.js';

/**
 * @typedef {object} DutyStore what of a page's store is used here
 * @property {import('../core/protocol-types.js').Duty | null} duty
 * @property {string} page
 * @property {boolean} isViewer
 * @property {boolean} isSilent
 * @property {(topic: any, listener: (detail?: any) => void) => () => void} on
 * @typedef {(sentence: string, title?: string, way?: import('../shell/notice.js').Way) => void} Say
 */

/**
 * Opens who is on duty here, and the list to sign on from.
 * @param {DutyStore & {name?: string}} store
 * @param {Say} say
 * @param {() => boolean} [mayOpen] called once it is loaded
 * @returns {Promise<boolean | null>} whether it opened; null: it could not be loaded
 */
export function openDuty(store, say, mayOpen = () => true) {
  return import('./sign-on.js').then(({ openSignOn }) => openSignOn(store, say, mayOpen)).catch(() => {
    say('The list of people could not be loaded.', 'Not opened');
    return null;
  });
}

/** Opens the hand-over that concerns this page. @param {import('../core/store.js').Store} store @param {import('./control.js').Say} say @param {(isByHand: boolean) => void} [onClosed] @param {() => boolean} [mayOpen] called once it is loaded */
export function openHandover(store, say, onClosed = () => {}, mayOpen = () => true) {
  import('./handover-sheet.js').then(({ HandoverSheet }) => {
    if (!mustWait() && mayOpen() && !document.querySelector('#sheet-handover[open]')) new HandoverSheet(store, say, onClosed);
  }).catch(() => say('The hand-over could not be loaded.', 'Not opened'));
}

/** @param {import('../core/store.js').Store} store @param {Say} say @returns {() => void} */
export function mount(store, say) {
  const menu = /** @type {HTMLDialogElement} */ (need(document, '#sheet-menu'));
  const draw = () => setText(field(menu, 'duty-words'), dutyWords(store.duty));
  draw();
  const stops = [
    store.on('duty', draw),
    store.on('draw', draw),
    listen(field(menu, 'duty'), 'click', () => {
      closeSheet(menu);
      void openDuty(store, say);
    }),
  ];
  return () => stops.forEach((stop) => stop());
}
