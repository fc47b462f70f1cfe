// What can be done with a recording: a sheet of actions, and the questions of each.

import { annotate, rename } from './file-annotations.js';
import { FileDialog } from './file-dialog.js';
import { FileMaker, KINDS } from './file-maker.js';
import { storeActions, storeItem } from './file-store.js';
import { FileTrash } from './file-trash.js';
import { chainLines, verify } from './file-verify.js';
import { byUrgency, factWords, nameOf, warningWords } from './files-layout.js';
import { addressOf } from './files-model.js';
import { keptAt } from '../core/kept-at.js';
import { share } from './files-share.js';
import { thumbnail } from './files-row.js';
import { duration } from '../core/format.js';
import { html, icon, setSentence, textNodes } from '../core/dom.js';
import { ICONS } from '../core/priority.js';
import { NO_ROOM, hasRoom } from '../replay/compare-room.js';
import { jumpAt } from '../replay/replay-jumps-layout.js';

/**
 * @typedef {import('./files-layout.js').Recording} Recording
 * @typedef {import('./files-model.js').FilesModel} FilesModel
 * @typedef {(sentence: string, title?: string, way?: import('../shell/notice.js').Way) => void} Say
 */

/** So many alarms are listed beside the list of recordings; all of them stand in its replay. */
const MOST_RAISED = 8;

/**
 * @param {NonNullable<Recording['raised']>[number]} alarm
 * @param {number} started_ms
 * @param {(at_s: number) => void} open the replay at a moment
 */
function raisedLine({ at_ms, priority, title, text }, started_ms, open) {
  const at_s = Math.max(0, at_ms - started_ms) / 1000;
  const key = html('button', { type: 'button', 'data-priority': priority }, html('span', { class: 'n' }, duration(at_s, true)), icon(ICONS[priority], `s ${priority === 'critical' ? 'c-crit' : priority === 'warning' ? 'c-warn' : ''}`),
    html('span', { class: 'tx' }, html('b', {}, ...textNodes(title)), ' ', ...textNodes(text)), icon('play', 's'));
  key.addEventListener('click', () => open(jumpAt({ at_s })));
  return html('li', {}, key);
}

export class FileSheet {
  /** @type {Recording | null} */
  #row = null;
  #dialog;
  /** What its dock shows: as the list had it, and since when it is open there. */
  #docked = '';
  #maker;
  #trash;

  /**
   * @param {import('../core/store.js').Store} store
   * @param {FilesModel} model
   * @param {Say} say
   * @param {HTMLElement} dock beside the list
   */
  constructor(store, model, say, dock) {
    this.#dialog = new FileDialog(dock);
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
    if (this.model.inStore !== null) storeActions(this.#dialog, /** @type {import('./stored-list.js').StoredRow} */ (row), this.name, this.#about());
    else if (row.trashed_ms === null) this.#actions();
    else this.#trash.show(row, this.#about());
    this.#dialog.open();
  }

  /**
   * On a desktop one recording always stands beside the list: this one, opened again when it changed or a step of it was closed.
   * @param {Recording | undefined} row
   */
  keep(row) {
    const dialog = this.#dialog;
    if (!dialog.isDocked) return;
    const key = row ? JSON.stringify([row, this.store.replaying && this.store.frame?.replay?.id, hasRoom()]) : '';
    if (key === this.#docked && (dialog.isOpen || !row)) return;
    if (row && dialog.isOpen && row.id === this.#row?.id && !this.isAtActions) return; // a step of it is under way
    this.#docked = key;
    if (row) this.open(row);
    else dialog.close();
  }

  /** All of the trash, after a question. @param {import('./files-layout.js').Total} total */
  askEmpty(total) {
    this.#trash.askEmpty(total);
  }

  get row() {
    if (!this.#row) throw new Error('No recording selected');
    return this.#row;
  }

  get name() {
    return nameOf(this.row, Date.now());
  }

  #about() {
    const { row } = this;
    return [
      html('p', {}, ...textNodes(factWords(row))),
      ...chainLines(row),
      ...warningWords(row).map((sentence) => html('p', { class: 'bad' }, ...textNodes(sentence))),
      ...(row.note ? [html('p', { class: 'note-text', dir: 'auto' }, row.note)] : []),
      ...(row.tags.length ? [html('p', {}, ...row.tags.map((tag) => html('bdi', { class: 'file-tag' }, tag)))] : []),
    ];
  }

  #actions() {
    const { row } = this;
    const isRead = row.state === 'read';
    const kind = row.several_files ? [] : (KINDS[row.format] ?? ['file', '']).slice(0, 1);
    const back = () => this.#actions();
    const { isDocked } = this.#dialog;
    const seen = isDocked && isRead ? [html('div', { class: 'file-way' }, thumbnail(row)), this.#raised(row)] : [];
    this.#dialog.show(this.name, this.#about(), [...seen, ...(isRead && row.marks ? [this.#marks(row)] : []), html('ul', { class: 'menu-list', 'data-f': 'file-actions' },
      ...(isRead ? [this.#dialog.item('replay', 'Open replay', () => this.#replay()), ...this.#beside()] : []),
      ...(isRead ? [this.#report(), this.#dialog.item('fit', 'Compare along the way', () => this.#compare())] : []),
      ...(row.several_files ? [] : [this.#dialog.item('share', 'Share', () => this.#share())]),
      ...(isRead ? [this.#dialog.item('mail', 'E-mail', () => this.#mail())] : []),
      this.#dialog.item('download', 'Download', () => this.#maker.download(row, back), [...kind, ...(isRead ? ['bag', 'CSV …'] : [])].join(' · ')),
      ...(isRead && row.alarms ? [this.#dialog.item('crit', 'Cut out an incident', () => this.#maker.incidents(row, back))] : []),
      ...(row.head ? [this.#dialog.item('ok', 'Verify', () => verify(this.#dialog, this.model, row, back))] : []),
      ...storeItem(this.#dialog, this.model, row, this.name, back),
      this.#dialog.item('edit', 'Rename', () => rename(this.#dialog, this.model, row)),
      this.#dialog.item('info', 'Note and tags', () => annotate(this.#dialog, this.model, row)),
      this.#dialog.item('trash', 'Delete', () => this.#trash.askDelete(row, back), 'confirm first'))]);
  }

  /** The drive's report as a page of its own, which can be printed and saved. */
  #report() {
    return html('li', {}, html('a', { href: keptAt(addressOf(this.row.id, '/report')), target: '_blank', rel: 'noopener', 'data-f': 'file-report' }, icon('files'), 'Drive report', html('span', { class: 'end' }, 'whole drive · A4')));
  }

  get isAtActions() {
    return this.#dialog.what.querySelector('[data-f="file-actions"]') !== null;
  }

  /** The alarms that were raised in it, once they are fetched. @param {Recording} row */
  #raised(row) {
    const list = html('ul', { class: 'file-raised', 'aria-label': 'Alarms' });
    const open = (/** @type {number} */ at_s) => void this.#replay(at_s);
    if (row.alarms) void this.#maker.raised(row).then((raised) => list.replaceChildren(...byUrgency(raised).slice(0, MOST_RAISED).map((alarm) => raisedLine(alarm, row.started_ms, open)),
      ...(raised.length > MOST_RAISED ? [html('li', { class: 'more' }, ...textNodes(`and ${raised.length - MOST_RAISED} more in the replay`))] : [])), () => {});
    return list;
  }

  /** What people marked in it, once that is fetched. @param {Recording} row */
  #marks({ id }) {
    const place = html('div', { class: 'file-marked' });
    import('../drive/recorded-marks.js').then(({ listOf }) => listOf(id, this.say, (at_s) => void this.#replay(at_s))).then((list) => list && place.replaceChildren(list), () => {});
    return place;
  }

  /** @param {number} [at_s] */
  async #replay(at_s = 0) {
    const { id } = this.row;
    const { openReplay } = await this.#module(() => import('../replay/replay.js'));
    this.#dialog.close();
    openReplay(id, this.store, this.say, { at_s });
  }

  /** A second recording beside the one that is replayed, or in a line why not. */
  #beside() {
    const replayed = this.store.frame?.replay?.id;
    if (!this.store.replaying || replayed === undefined) return [];
    if (replayed === this.row.id) return [html('li', { class: 'sub why' }, 'Shown in the replay now')];
    if (!hasRoom()) return [html('li', { class: 'sub why' }, ...textNodes(NO_ROOM))];
    return [this.#dialog.item('plus', 'Compare with the replay', async () => {
      const { openBeside } = await this.#module(() => import('../replay/compare.js'));
      this.#dialog.close();
      void openBeside(this.row.id, this.store, this.say);
    })];
  }

  async #compare() {
    const { id, vehicle } = this.row;
    const { openCompareWay } = await this.#module(() => import('../drive/compare-way.js'));
    this.#dialog.close();
    void openCompareWay(vehicle, id, this.store);
  }

  async #mail() {
    const { id } = this.row;
    const { openMail } = await this.#module(() => import('./mail.js'));
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
      this.#dialog.refuse('Not opened', 'This part of the page could not be loaded from the server. Try again.', () => this.#actions());
      return new Promise(() => {});
    }
  }

  async #share() {
    const { row } = this;
    const address = new URL(keptAt(addressOf(row.id, '/file.mcap')), location.href).href;
    const status = html('p', { role: 'status' }, 'Getting ready to share.');
    this.#dialog.show(`Share ${this.name}`, [status], []);
    await share({ row, name: this.name, address, say: (sentence) => setSentence(status, sentence), offer: (label, act) => this.#dialog.what.replaceChildren(html('div', { class: 'keys' }, this.#dialog.key(label, act, 'main'))),
      link: () => {
        const box = /** @type {HTMLInputElement} */ (html('input', { type: 'text', readonly: true, value: address, 'aria-label': 'Link to the recording' }));
        this.#dialog.what.replaceChildren(html('div', { class: 'form-lines' }, box));
        box.select();
      },
      done: () => this.#dialog.close() });
  }
}
