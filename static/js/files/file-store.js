// The copy of a recording in the store: requested from the server that has the recording, fetched by one that has none.

import { request, sentenceOf } from '../control/request.js';
import { addressOf } from './files-model.js';
import { sizeWords, storedWords } from './files-layout.js';
import { html, icon, textNodes } from '../core/dom.js';
import { timeOfDay } from '../core/format.js';

/**
 * @typedef {import('./file-dialog.js').FileDialog} FileDialog
 * @typedef {import('./files-layout.js').Recording} Recording
 * @typedef {import('./files-model.js').FilesModel} FilesModel
 * @typedef {import('./stored-list.js').StoredRow} StoredRow
 */

/** What can be had of a recording that is only in the store. @param {FileDialog} dialog @param {StoredRow} row @param {string} name @param {(Node | string)[]} about */
export function storeActions(dialog, row, name, about) {
  const { file, clips, folder, id, size_bytes } = row.of;
  const base = `/api/stored/${encodeURIComponent(folder)}/${encodeURIComponent(id)}`;
  dialog.show(name, about, [html('ul', { class: 'menu-list', 'data-f': 'file-actions' },
    ...(file === null ? [html('li', { class: 'sub why' }, 'The whole file is kept at the agent of the car.')] : [link(`${base}/file`, 'Whole file', file, size_bytes)]),
    ...clips.map((clip) => link(`${base}/clips/${encodeURIComponent(clip.name)}`, `Alarm at ${timeOfDay(clip.at_ms)}`, clip.name, clip.size_bytes)))]);
}

/** @param {string} href @param {string} label @param {string} sub @param {number | null} bytes */
function link(href, label, sub, bytes) {
  return html('li', {}, html('a', { href, download: '' }, icon('download'), html('span', { class: 'tx' }, html('b', {}, ...textNodes(label)), html('small', {}, ...textNodes(sub))), html('span', { class: 'end' }, ...textNodes(sizeWords(bytes)))));
}

/**
 * The line of a recording's menu that leads to its copy; none where the server has no store.
 * @param {FileDialog} dialog
 * @param {FilesModel} model
 * @param {Recording} row
 * @param {string} name
 * @param {() => void} back
 */
export function storeItem(dialog, model, row, name, back) {
  const { stored } = row;
  return stored ? [dialog.item('upload', 'Copy in the store', () => ask(dialog, model, row, name, back), stored.state === 'stored' ? 'stored' : 'not stored')] : [];
}

/** @param {FileDialog} dialog @param {FilesModel} model @param {Recording} row @param {string} name @param {() => void} back */
function ask(dialog, model, row, name, back) {
  const { stored } = row;
  if (!stored) return;
  /** @param {string} method @param {object} [body] */
  const send = async (method, body) => {
    try {
      await request(addressOf(row.id, '/store'), { method, ...(body ? { body } : {}) });
      await model.refresh();
      dialog.close();
    } catch (error) {
      dialog.refuse('Not done', sentenceOf(error), back);
    }
  };
  const isStored = stored.state === 'stored';
    const state = storedWords(stored);
  dialog.show(`Copy of ${name}`, [
    html('p', {}, ...textNodes(`${state[0]?.toUpperCase() ?? ''}${state.slice(1)}${/[.…]$/.test(state) ? '' : '.'}`)),
    ...(stored.state === 'none' && stored.sentence ? [html('p', {}, ...textNodes(stored.sentence))] : []),
    ...(stored.clips ? [html('p', {}, ...textNodes(`${stored.clips} ${stored.clips === 1 ? 'clip' : 'clips'} around alarms stored.`))] : []),
    ...(stored.is_deletion_asked ? [html('p', {}, 'It is deleted here once the copy was read back and is the same.')] : []),
  ], [], [
    ...(isStored || stored.state === 'uploading' || stored.state === 'waiting' ? [] : [dialog.key('Upload the whole file', () => void send('POST', { delete: false }), 'main')]),
    ...(stored.is_deletion_asked ? [] : [dialog.key(isStored ? 'Delete it here' : 'Upload, then delete it here', () => confirm(dialog, name, () => void send('POST', { delete: true }), back))]),
    ...(stored.is_asked ? [dialog.key('Cancel the request', () => void send('DELETE'))] : []),
    dialog.key('Back', back),
  ]);
}

/** @param {FileDialog} dialog @param {string} name @param {() => void} act @param {() => void} back */
function confirm(dialog, name, act, back) {
  dialog.show(`Delete ${name} here?`, [html('p', {}, ...textNodes('It is deleted on this server for good, once its copy in the store was read back and is the same. The copy stays.'))], [], [dialog.key('Delete after the check', act, 'main'), dialog.key('Back', back)], 'Keep it');
}
