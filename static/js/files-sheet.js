// What can be done with a recording: a sheet of actions, and beneath each what it asks.

import { addSheet, closeSheet, openSheet } from './sheet.js';
import { FileJob, save } from './files-job.js';
import { factWords, nameOf, sizeWords, tagsOf, warningWords } from './files-layout.js';
import { addressOf, request, sentenceOf } from './files-model.js';
import { share } from './files-share.js';
import { html, icon, listen, setText, setWords, words } from './dom.js';
import { timeOfDay } from './words.js';

/** What only an operator may do with a recording, by its icon. */
const CHANGES = ['mail', 'crit', 'edit', 'info', 'trash'];

/**
 * @typedef {import('./files-layout.js').Recording} Recording
 * @typedef {import('./files-model.js').FilesModel} FilesModel
 * @typedef {(sentence: string, title?: string, way?: import('./notice.js').Way) => void} Say
 */

/** What a recording can be had as: the name by which the server makes it, what it is called, and what it is for. */
const FORMATS = /** @type {const} */ ([
  ['bag', 'ROS 1 bag', 'for rosbag and rqt'],
  ['ros2', 'ROS 2 bag', 'for ros2 bag and rosbags, zipped'],
  ['csv', 'CSV tables', 'one for each signal, zipped'],
  ['gpx', 'GPX track', 'for maps and watches'],
  ['geojson', 'GeoJSON track', 'for QGIS and web maps'],
  ['html', 'HTML report', 'plots and alarms in one page, works offline'],
]);
const KINDS = /** @type {Record<string, [string, string]>} */ ({ mcap: ['MCAP', 'all of it, for Foxglove and Lichtblick'], bag: ['ROS 1 bag', 'the file as it is'], db3: ['ROS 2 db3', 'the file as it is'] });
const CLIP_S = 30; // before and after an alarm
const PRIORITY_ICONS = { critical: 'crit', warning: 'warn', advisory: 'info' };

export class FileSheet {
  /** @type {Recording | null} */
  #row = null;
  /** @type {FileJob | null} */
  #job = null;

  /**
   * @param {import('./store.js').Store} store
   * @param {FilesModel} model
   * @param {Say} say
   */
  constructor(store, model, say) {
    this.store = store;
    this.model = model;
    this.say = say;
    const nth = document.querySelectorAll('.file-sheet').length || ''; // another one may lie beneath the connect screen
    this.title = html('h2', { id: `file-title${nth}`, tabindex: -1, dir: 'auto' });
    this.about = html('div', { class: 'bd', id: `file-about${nth}` });
    this.what = html('div', { class: 'what' });
    this.keys = html('div', { class: 'keys' });
    this.close = html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close');
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed file-sheet', id: `sheet-file${nth}`, 'aria-labelledby': `file-title${nth}`, 'aria-describedby': `file-about${nth}` }, this.about, this.what, this.keys));
    this.keys.append(this.close);
    this.take = addSheet(this.sheet);
    this.stops = [listen(this.sheet, 'close', () => this.#job?.giveUp())];
  }

  stop() {
    this.#job?.giveUp();
    for (const stop of this.stops) stop();
    this.take();
  }

  /** @param {Recording} row */
  open(row) {
    this.#row = row;
    if (row.trashed_ms === null) this.#actions();
    else this.#trashed();
    openSheet(this.sheet);
  }

  /**
   * @param {string} title
   * @param {(Node | string)[]} about
   * @param {Node[]} what
   * @param {Node[]} keys above the one that closes
   * @param {string} [closes] what that one is called
   */
  #show(title, about, what, keys = [], closes = 'Close') {
    setText(this.title, title);
    this.about.replaceChildren(this.title, ...about);
    this.what.replaceChildren(...what);
    this.keys.replaceChildren(...keys, this.close);
    setText(this.close, closes);
    this.what.scrollTop = 0;
    if (this.sheet.open) this.title.focus();
  }

  /**
   * @param {string} glyph
   * @param {string} label
   * @param {() => void} act
   * @param {string} [end] a word at its end
   */
  #item(glyph, label, act, end = '') {
    const key = html('button', { type: 'button', 'data-operator': CHANGES.includes(glyph) }, icon(glyph), label, ...(end ? [html('span', { class: 'end' }, ...words(end))] : []));
    listen(key, 'click', act);
    return html('li', {}, key);
  }

  /** @param {string} label @param {() => void} act @param {string} [kind] */
  #key(label, act, kind = 'key') {
    const key = html('button', { type: 'button', class: kind }, label);
    listen(key, 'click', act);
    return key;
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
    this.#show(this.name, this.#about(), [html('ul', { class: 'menu-list' },
      ...(isRead ? [this.#item('replay', 'Open replay', () => this.#replay())] : []),
      this.#item('share', 'Share', () => this.#share()),
      ...(isRead ? [this.#item('mail', 'E-mail', () => this.#mail())] : []),
      this.#item('download', 'Download', () => this.#download(), isRead ? `${kind[0]} · bag · CSV …` : kind[0]),
      ...(isRead && row.alarms ? [this.#item('crit', 'Cut out an incident', () => this.#incidents())] : []),
      this.#item('edit', 'Rename', () => this.#rename()),
      this.#item('info', 'Note and tags', () => this.#remark()),
      this.#item('trash', 'Delete', () => this.#askDelete(), 'asks first'))]);
  }

  async #replay() {
    const { id } = this.row;
    const { openReplay } = await this.#module(() => import('./replay.js'));
    closeSheet(this.sheet);
    openReplay(id, this.store, this.say);
  }

  async #mail() {
    const { id } = this.row;
    const { openMail } = await this.#module(() => import('./mail.js'));
    closeSheet(this.sheet);
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
      this.#refused('Not opened', 'This part of the page could not be fetched from the server. Try again.');
      return new Promise(() => {});
    }
  }

  /** @param {string} title @param {string} sentence */
  #refused(title, sentence) {
    this.#show(title, [html('p', { class: 'bad', role: 'alert' }, ...words(sentence))], [], [this.#key('Back', () => this.#actions())]);
  }

  async #share() {
    const { row } = this;
    const address = new URL(addressOf(row.id, '/file.mcap'), location.href).href;
    const said = html('p', { role: 'status' }, 'Getting ready to share.');
    this.#show(`Share ${this.name}`, [said], []);
    await share({ row, name: this.name, address, say: (sentence) => setWords(said, sentence), offer: (label, act) => this.what.replaceChildren(html('div', { class: 'keys' }, this.#key(label, act, 'main'))),
      link: () => {
        const box = /** @type {HTMLInputElement} */ (html('input', { type: 'text', readonly: true, value: address, 'aria-label': 'Link to the recording' }));
        this.what.replaceChildren(html('div', { class: 'form-lines' }, box));
        box.select();
      },
      done: () => closeSheet(this.sheet) });
  }

  // -- download ------------------------------------------------------------------------------------------------------

  #download() {
    const { row } = this;
    const kind = KINDS[row.format] ?? ['File', 'as it is'];
    const asItIs = html('a', { href: addressOf(row.id, '/file.mcap'), download: '' }, icon('download'), html('span', { class: 'tx' }, html('b', {}, kind[0]), html('small', {}, kind[1])), html('span', { class: 'end' }, ...words(sizeWords(row.size_bytes))));
    listen(asItIs, 'click', () => setTimeout(() => closeSheet(this.sheet)));
    const made = row.state === 'read' ? FORMATS.filter(([format]) => format !== row.format && (format !== 'ros2' || row.ros_version === 2)) : [];
    this.#show(`Download ${this.name}`, [html('p', { class: 'sub' }, 'Other formats are made on request.')], [html('ul', { class: 'menu-list' }, html('li', {}, asItIs),
      ...made.map(([format, label, use]) => {
        const key = html('button', { type: 'button', 'data-format': format, 'data-operator': true }, icon('download'), html('span', { class: 'tx' }, html('b', {}, label), html('small', {}, use)));
        listen(key, 'click', () => this.#make(format, label));
        return html('li', {}, key);
      }))], [this.#key('Back', () => this.#actions())]);
  }

  /** @param {string} format @param {string} label */
  async #make(format, label) {
    const job = new FileJob(addressOf(this.row.id, '/exports'), { format }, (told) => bar.tell(told));
    const bar = this.#progress(`Making the ${label}`, job);
    const over = await job.run();
    if (this.#job !== job || !this.sheet.open) return;
    if (over.state === 'done') {
      save(job.address);
      this.#show(`${label} of ${this.name}`, [html('p', { role: 'status' }, `Done. It is saved among this phone’s downloads.${over.is_whole === false ? ' Not all of the recording is in it:' : ''}`), ...(over.notes ?? []).map((note) => html('p', {}, ...words(note)))], [], [this.#key('Save again', () => save(job.address)), this.#key('Back', () => this.#download())]);
    } else if (over.state === 'cancelled') this.#download();
    else this.#refused('Not made', over.sentence ?? 'The server could not make it.');
  }

  /** @param {string} title @param {FileJob} job */
  #progress(title, job) {
    this.#job?.giveUp();
    this.#job = job;
    const bar = /** @type {HTMLProgressElement} */ (html('progress', { max: 1, value: 0, 'aria-label': title }));
    const said = html('p', { role: 'status' });
    setWords(said, 'The server begins.');
    this.#show(title, [], [html('div', { class: 'progress' }, bar, said)], [this.#key('Cancel', () => job.giveUp())]);
    return {
      /** @param {import('./files-job.js').Job} told */
      tell: ({ progress, sentence }) => {
        if (progress !== null) bar.value = progress;
        setWords(said, sentence ?? `${Math.round((progress ?? 0) * 100)} % done.`);
      },
    };
  }

  // -- incidents -----------------------------------------------------------------------------------------------------

  async #incidents() {
    const { id } = this.row;
    /** @type {Recording} */
    let row;
    try {
      row = await request(addressOf(id));
    } catch (error) {
      this.#refused('Not fetched', sentenceOf(error));
      return;
    }
    const raised = row.raised ?? [];
    this.#show('Cut out an incident', [html('p', { class: 'sub' }, ...words(raised.length ? `From ${CLIP_S} s before an alarm to ${CLIP_S} s after it, as a recording of its own.` : 'No alarm was raised in this recording.'))],
      [html('ul', { class: 'menu-list' }, ...raised.map((alarm) => {
        const key = html('button', { type: 'button' }, icon(PRIORITY_ICONS[alarm.priority], alarm.priority === 'critical' ? 'c-crit' : alarm.priority === 'warning' ? 'c-warn' : ''),
          html('span', { class: 'tx' }, html('b', {}, ...words(alarm.title)), html('small', {}, ...words(alarm.text))), html('span', { class: 'end n' }, timeOfDay(alarm.at_ms)));
        listen(key, 'click', () => this.#cut(alarm.at_ms));
        return html('li', {}, key);
      }))], [this.#key('Back', () => this.#actions())]);
  }

  /** @param {number} at_ms */
  async #cut(at_ms) {
    const job = new FileJob(addressOf(this.row.id, '/clip'), { at_ms, before_s: CLIP_S, after_s: CLIP_S }, (told) => bar.tell(told));
    const bar = this.#progress('Cutting out the incident', job);
    const over = await job.run();
    if (this.#job !== job || !this.sheet.open) return;
    if (over.state === 'done') {
      await this.model.refresh();
      const made = this.model.rows.find(({ id }) => id === over.recording);
      if (made) this.open(made);
      else closeSheet(this.sheet);
      this.say('The clip is in the list, as a recording of its own.', 'Incident cut out');
    } else if (over.state === 'cancelled') this.#actions();
    else this.#refused('Not cut out', over.sentence ?? 'The server could not make it.');
  }

  // -- what people say of it -------------------------------------------------------------------------------------------

  #rename() {
    const input = /** @type {HTMLInputElement} */ (html('input', { type: 'text', id: 'file-name', value: this.row.title, maxlength: 120, autocomplete: 'off', enterkeyhint: 'done', dir: 'auto' }));
    const refused = html('p', { class: 'bad', role: 'alert' });
    const keep = () => this.#keep({ title: input.value }, refused);
    this.#show(`Rename ${this.name}`, [refused], [html('div', { class: 'form-lines' }, html('label', { for: 'file-name' }, 'Name'), input, html('p', { class: 'sub' }, 'Empty: called by its time.'))],
      [this.#key('Save the name', keep, 'main')], 'Cancel');
    listen(input, 'keydown', (event) => {
      if (event.key === 'Enter') keep();
    });
    input.focus();
    input.select();
  }

  #remark() {
    const { row } = this;
    const note = /** @type {HTMLTextAreaElement} */ (html('textarea', { id: 'file-note', maxlength: 4000, rows: 4, dir: 'auto' }));
    note.value = row.note;
    const tags = /** @type {HTMLInputElement} */ (html('input', { type: 'text', id: 'file-tags', value: row.tags.join(', '), autocomplete: 'off', dir: 'auto' }));
    const refused = html('p', { class: 'bad', role: 'alert' });
    this.#show(`Note and tags of ${this.name}`, [refused], [html('div', { class: 'form-lines' }, html('label', { for: 'file-note' }, 'Note'), note, html('label', { for: 'file-tags' }, 'Tags, with commas between'), tags)],
      [this.#key('Save', () => this.#keep({ note: note.value, tags: tagsOf(tags.value) }, refused), 'main')], 'Cancel');
    note.focus();
  }

  /** @param {{title?: string, note?: string, tags?: string[]}} remarks @param {HTMLElement} refused */
  async #keep(remarks, refused) {
    try {
      await this.model.remark(this.row, remarks);
      closeSheet(this.sheet);
    } catch (error) {
      setWords(refused, `Not saved. ${sentenceOf(error)}`);
    }
  }

  // -- deleting --------------------------------------------------------------------------------------------------------

  #askDelete() {
    this.#show(`Delete ${this.name}?`, [html('p', {}, ...words('It is moved to the trash and can be restored until the trash is emptied.'))], [], [this.#key('Delete', () => this.#delete(), 'main')], 'Keep it');
  }

  async #delete() {
    const { row, name } = this;
    try {
      await this.model.remove(row.id);
    } catch (error) {
      this.#refused('Not deleted', sentenceOf(error));
      return;
    }
    closeSheet(this.sheet);
    this.say(`${name} is in the trash.`, 'Deleted', { label: 'Undo', act: () => this.#restore(row, name) });
  }

  /** @param {Recording} row @param {string} name */
  async #restore(row, name) {
    try {
      await this.model.restore(row.id);
      this.say(`${name} is in the list again.`, 'Taken back');
    } catch (error) {
      this.say(sentenceOf(error), 'Not taken back');
    }
  }

  #trashed() {
    const { row, name } = this;
    this.#show(name, this.#about(), [html('ul', { class: 'menu-list' },
      this.#item('replay', 'Take it back', async () => {
        closeSheet(this.sheet);
        await this.#restore(row, name);
      }),
      this.#item('trash', 'Delete for good', () => this.#askDestroy(row.id, `Delete ${name} for good?`, `${sizeWords(row.size_bytes)} are freed. It cannot be taken back.`), 'asks first'))]);
  }

  /** All of the trash, after a question. @param {import('./files-layout.js').Total} total */
  askEmpty({ count, bytes }) {
    this.#askDestroy(null, 'Empty the trash?', `${count === 1 ? '1 recording is' : `${count} recordings are`} deleted for good, ${sizeWords(bytes)} are freed. ${count === 1 ? 'It' : 'They'} cannot be taken back.`);
    openSheet(this.sheet);
  }

  /** @param {string | null} id @param {string} title @param {string} sentence */
  #askDestroy(id, title, sentence) {
    this.#show(title, [html('p', {}, ...words(sentence))], [], [this.#key(id === null ? 'Empty the trash' : 'Delete for good', async () => {
      try {
        await this.model.destroy(id);
        closeSheet(this.sheet);
      } catch (error) {
        this.#show('Not deleted', [html('p', { class: 'bad', role: 'alert' }, ...words(sentenceOf(error)))], []);
      }
    }, 'main')], 'Keep');
  }
}
