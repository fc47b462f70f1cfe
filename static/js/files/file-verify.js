// Whether a recording is as it was recorded: shown only where the server has verified this very file.

import { request, sentenceOf } from '../control/request.js';
import { addressOf } from './files-model.js';
import { nameOf } from './files-layout.js';
import { html, textNodes } from '../core/dom.js';

/** @typedef {import('./files-layout.js').Recording} Recording */

/** What the last verification found; nothing where there was none. @param {Recording} row */
export function chainLines({ verified }) {
  if (!verified) return [];
  return [html('p', verified.is_broken ? { class: 'bad', 'data-f': 'chain' } : { 'data-f': 'chain' }, ...textNodes(`Event log: ${verified.short}`))];
}

/**
 * Has the server read the whole file.
 * @param {import('./file-dialog.js').FileDialog} dialog
 * @param {import('./files-model.js').FilesModel} model
 * @param {Recording} row
 * @param {() => void} back
 */
export async function verify(dialog, model, row, back) {
  const name = nameOf(row, Date.now());
  const status = html('p', { role: 'status' }, 'Verifying: the server reads the whole file.');
  dialog.show(`Verify ${name}`, [status], [], [dialog.key('Back', back)]);
  const isWanted = () => dialog.isOpen && status.isConnected;
  try {
    /** @type {import('../core/protocol-types.js').VerificationAnswer} */
    const verified = await request(addressOf(row.id, '/verify'));
    row.verified = verified;
    if (isWanted()) dialog.show(`Verify ${name}`, [html('p', { role: 'status', 'data-f': 'verified', ...(verified.is_broken ? { class: 'bad' } : {}) }, html('b', {}, ...textNodes(verified.short))), html('p', { class: 'chain-words' }, ...textNodes(verified.sentence))], [], [dialog.key('Back', back)]);
    void model.refresh();
  } catch (error) {
    if (isWanted()) dialog.refuse('Not verified', sentenceOf(error), back);
  }
}
