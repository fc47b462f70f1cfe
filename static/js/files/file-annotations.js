// What people say of a recording: its name, the weather, a note, tags.

import { nameOf, tagsOf } from './files-layout.js';
import { sentenceOf } from '../control/request.js';
import { html, listen, setSentence } from '../core/dom.js';

/**
 * @typedef {import('./file-dialog.js').FileDialog} FileDialog
 * @typedef {import('./files-layout.js').Recording} Recording
 * @typedef {import('./files-model.js').FilesModel} FilesModel
 */

/** @param {FileDialog} dialog @param {FilesModel} model @param {Recording} row */
export function rename(dialog, model, row) {
  const input = /** @type {HTMLInputElement} */ (html('input', { type: 'text', id: 'file-name', value: row.title, maxlength: 120, autocomplete: 'off', enterkeyhint: 'done', dir: 'auto' }));
  const refused = html('p', { class: 'bad', role: 'alert' });
  const done = () => keep(dialog, model, row, { title: input.value }, refused);
  dialog.show(`Rename ${nameOf(row, Date.now())}`, [refused], [html('div', { class: 'form-lines' }, html('label', { for: 'file-name' }, 'Name'), input, html('p', { class: 'sub' }, 'Empty: named by its time.'))],
    [dialog.key('Save the name', done, 'main')], 'Cancel');
  listen(input, 'keydown', (event) => {
    if (event.key === 'Enter') done();
  });
  input.focus();
  input.select();
}

/** @param {FileDialog} dialog @param {FilesModel} model @param {Recording} row */
export function annotate(dialog, model, row) {
  const note = /** @type {HTMLTextAreaElement} */ (html('textarea', { id: 'file-note', maxlength: 4000, rows: 4, dir: 'auto' }));
  note.value = row.note;
  const weather = /** @type {HTMLInputElement} */ (html('input', { type: 'text', id: 'file-weather', value: row.weather ?? '', maxlength: 120, autocomplete: 'off', dir: 'auto' }));
  const tags = /** @type {HTMLInputElement} */ (html('input', { type: 'text', id: 'file-tags', value: row.tags.join(', '), autocomplete: 'off', dir: 'auto' }));
  const refused = html('p', { class: 'bad', role: 'alert' });
  dialog.show(`Note and tags of ${nameOf(row, Date.now())}`, [refused], [html('div', { class: 'form-lines' }, html('label', { for: 'file-note' }, 'Note'), note, html('label', { for: 'file-weather' }, 'Weather, for the report'), weather, html('label', { for: 'file-tags' }, 'Tags, separated by commas'), tags)],
    [dialog.key('Save', () => keep(dialog, model, row, { note: note.value, weather: weather.value, tags: tagsOf(tags.value) }, refused), 'main')], 'Cancel');
  note.focus();
}

/**
 * @param {FileDialog} dialog
 * @param {FilesModel} model
 * @param {Recording} row
 * @param {{title?: string, note?: string, weather?: string, tags?: string[]}} annotations
 * @param {HTMLElement} refused where a refusal is shown
 */
async function keep(dialog, model, row, annotations, refused) {
  try {
    await model.remark(row, annotations);
    dialog.close();
  } catch (error) {
    setSentence(refused, `Not saved. ${sentenceOf(error)}`);
  }
}
