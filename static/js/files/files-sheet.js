// What can be done with a recording: a sheet of actions, and beneath each what it asks.

import { annotate, rename } from './file-annotations.js';
import { FileDialog } from './file-dialog.js';
import { FileMaker, KINDS } from './file-maker.js';
import { FileTrash } from './file-trash.js';
import { factWords, nameOf, warningWords } from './files-layout.js';
import { addressOf } from './files-model.js';
import { share } from './files-share.js';
import { html, setWords, words } from '../core/dom.js';

/**
 * @typedef {import('./files-layout.js').Recording} Recording
 * @typedef {import('./files-model.js').FilesModel} FilesModel
 * @typedef {(sentence: string, title?: string, way?: import('../shell/notice.js').Way) => void} Say
 */

export class FileSheet {
  /** @type {Recording | null} */
  #row = null;
  #dialog = new FileDialog();
  #maker;
  #trash;

  /**
   * @param {import('../core/store.js').Store} store
   * @param {FilesModel} model
   * @param {Say} say
   */
  constructor(store, model, say) {
    this.store = store;
    this.model = model;
    this.say = say;
    this.#maker = new FileMaker(this.#dialog, model, say, (row) => this.open(row));
    this.#trash = new FileTrash(this.#dialog, model, say);
    this.off = this.#dialog.onClose(() => this.#maker.giveUp());
  }

  stop() {
    this.#maker.giveUp();
    this.off();
    this.#dialog.remove();
  }

  /** @param {Recording} row */
  open(row) {
    this.#row = row;
    if (row.trashed_ms === null) this.#actions();
    else this.#trash.show(row, this.#about());
    this.#dialog.open();
  }

  /** All of the trash, after a question. @param {import('./files-layout.js').Total} total */
  askEmpty(total) {
    this.#trash.askEmpty(total);
  }

  get row() {
    if (!this.#row) throw new Error('No recording was chosen');
    return this.#row;
  }

  get name() {
    return nameOf(this.row, Date.now());
  }

  #about() {
    const { row } = this;
    return [
      html('p', {}, ...words(factWords(row))),
      ...warningWords(row).map((sentence) => html('p', { class: 'bad' }, ...words(sentence))),
      ...(row.note ? [html('p', { class: 'note-text', dir: 'auto' }, row.note)] : []),
      ...(row.tags.length ? [html('p', {}, ...row.tags.map((tag) => html('bdi', { class: 'chip' }, tag)))] : []),
    ];
  }

  #actions() {
    const { row } = this;
    const isRead = row.state === 'read';
    const kind = KINDS[row.format] ?? ['file', ''];
    const back = () => this.#actions();
    this.#dialog.show(this.name, this.#about(), [html('ul', { class: 'menu-list' },
      ...(isRead ? [this.#dialog.item('replay', 'Open replay', () => this.#replay())] : []),
      this.#dialog.item('share', 'Share', () => this.#share()),
      ...(isRead ? [this.#dialog.item('mail', 'E-mail', () => this.#mail())] : []),
      this.#dialog.item('download', 'Download', () => this.#maker.download(row, back), isRead ? `${kind[0]} · bag · CSV …` : kind[0]),
      ...(isRead && row.alarms ? [this.#dialog.item('crit', 'Cut out an incident', () => this.#maker.incidents(row, back))] : []),
      this.#dialog.item('edit', 'Rename', () => rename(this.#dialog, this.model, row)),
      this.#dialog.item('info', 'Note and tags', () => annotate(this.#dialog, this.model, row)),
      this.#dialog.item('trash', 'Delete', () => this.#trash.askDelete(row, back), 'asks first'))]);
  }

  async #replay() {
    const { id } = this.row;
    const { openReplay } = await this.#module(() => import('../replay/replay.js'));
    this.#dialog.close();
    openReplay(id, this.store, this.say);
  }

  async #mail() {
    const { id } = this.row;
    const { openMail } = await this.#module(() => import('../mail/mail.js'));
    this.#dialog.close();
    openMail([id], this.store, this.say);
  }

  /**
   * A part of the page that is fetched when it is wanted; what follows waits for ever where it does not come.
   * @template T
   * @param {() => Promise<T>} load
   * @returns {Promise<T>}
   */
  async #module(load) {
    try {
      return await load();
    } catch {
      this.#dialog.refuse('Not opened', 'This part of the page could not be fetched from the server. Try again.', () => this.#actions());
      return new Promise(() => {});
    }
  }

  async #share() {
    const { row } = this;
    const address = new URL(addressOf(row.id, '/file.mcap'), location.href).href;
    const said = html('p', { role: 'status' }, 'Getting ready to share.');
    this.#dialog.show(`Share ${this.name}`, [said], []);
    await share({ row, name: this.name, address, say: (sentence) => setWords(said, sentence), offer: (label, act) => this.#dialog.what.replaceChildren(html('div', { class: 'keys' }, this.#dialog.key(label, act, 'main'))),
      link: () => {
        const box = /** @type {HTMLInputElement} */ (html('input', { type: 'text', readonly: true, value: address, 'aria-label': 'Link to the recording' }));
        this.#dialog.what.replaceChildren(html('div', { class: 'form-lines' }, box));
        box.select();
      },
      done: () => this.#dialog.close() });
  }
}
