// Starting and ending the recording by hand. While the car moves, or may move, ending it needs a confirmation.

import { addSheet, closeSheet, openSheet } from './sheet.js';
import { html, icon, listen, textNodes } from '../core/dom.js';
import { speedWords } from '../core/units.js';

/** As the checks have it [m/s]: slower, the car stands. */
const MOVES_ABOVE_MPS = 0.3;

/**
 * Why ending the recording needs a confirmation; null: the car stands.
 * @param {{ink: string, value_mps: number | null}} speed
 */
export function askedBecause({ ink, value_mps }) {
  if (ink !== 'fresh' || value_mps === null) return 'It is not known whether the car moves.';
  return Math.abs(value_mps) > MOVES_ABOVE_MPS ? `The car moves at ${speedWords(Math.abs(value_mps)).join(' ')}.` : null;
}

/**
 * Start or end the recording; ends at once where the car stands.
 * @param {boolean} on
 * @param {import('../core/store.js').Store} store
 * @param {(sentence: string, title?: string) => void} say
 */
export function record(on, store, say) {
  const why = on ? null : askedBecause({ ink: store.replaying || store.isSilent ? 'unknown' : store.ink('speed').ink, value_mps: store.signal('speed')?.value?.speed_mps ?? null });
  if (why === null) return void send(on, store, say);
  const { vehicle } = store;
  const yes = html('button', { type: 'button', class: 'main', 'data-f': 'yes' }, 'End the recording');
  const sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-record', role: 'alertdialog', 'aria-labelledby': 'record-title', 'aria-describedby': 'record-words' },
    html('div', { class: 'bd' }, html('h2', {}, icon('rec'), html('span', { id: 'record-title' }, 'End the recording?')),
      html('p', { id: 'record-words' }, ...textNodes(`${why} What it does from now on would not be recorded.`))),
    html('div', { class: 'keys' }, yes, html('button', { type: 'button', class: 'key', 'data-f': 'no', autofocus: true }, 'Keep recording'))));
  const take = addSheet(sheet);
  const offSwitch = store.on('switch', () => closeSheet(sheet)); // it was about the car before
  listen(sheet, 'close', () => {
    offSwitch();
    take();
  });
  listen(yes, 'click', () => {
    closeSheet(sheet);
    if (store.vehicle === vehicle) void send(false, store, say);
  });
  openSheet(sheet);
}

/** @param {boolean} on @param {import('../core/store.js').Store} store @param {(sentence: string, title?: string) => void} say */
async function send(on, store, say) {
  const answer = await store.ask('record', { on });
  if (!answer.ok) say(answer.reason ?? 'Refused.', on ? 'Not recording' : 'Recording continues');
  else if (!on) say('The recording is saved and listed. The car is still monitored.', 'Recording ended');
}
