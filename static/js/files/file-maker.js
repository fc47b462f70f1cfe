// What the server makes of a recording: other formats to download, and the time around an alarm as a recording of its own.

import { FileJob, save } from './files-job.js';
import { nameOf, sizeWords, whyNotAsItIs } from './files-layout.js';
import { keptAt } from '../core/kept-at.js';
import { request, sentenceOf } from '../control/request.js';
import { addressOf } from './files-model.js';
import { html, icon, listen, setSentence, textNodes } from '../core/dom.js';
import { timeOfDay } from '../core/format.js';
import { ICONS, ranked } from '../core/priority.js';

/** @typedef {import('./files-layout.js').Recording} Recording */

export const KINDS = /** @type {Record<string, [string, string]>} */ ({ mcap: ['MCAP', 'all of it, for Foxglove and Lichtblick'], bag: ['ROS 1 bag', 'the file as it is'], db3: ['ROS 2 db3', 'the file as it is'], zstd: ['Packed MCAP or db3', 'the file as it is, packed with zstd'] });
const CLIP_S = 30; // before and after an alarm

export class FileMaker {
  /** @type {FileJob | null} */
  #job = null;
  #dialog;
  #model;
  #say;
  #open;

  /**
   * @param {import('./file-dialog.js').FileDialog} dialog
   * @param {import('./files-model.js').FilesModel} model
   * @param {import('./files-sheet.js').Say} say
   * @param {(row: Recording) => void} open opens the sheet of a recording that was made
   */
  constructor(dialog, model, say, open) {
    this.#dialog = dialog;
    this.#model = model;
    this.#say = say;
    this.#open = open;
  }

  /** What is being made is not wanted any more. */
  giveUp() {
    this.#job?.giveUp();
  }

  /** What it can be had as. @param {Recording} row @param {() => void} back */
  download(row, back) {
    const name = nameOf(row, Date.now());
    const kind = KINDS[row.format] ?? ['File', 'as it is'];
    const why = whyNotAsItIs(row);
    const asItIs = why ? html('span', { class: 'sub why' }, ...textNodes(why)) : html('a', { href: keptAt(addressOf(row.id, '/file.mcap')), download: '' }, icon('download'), html('span', { class: 'tx' }, html('b', {}, kind[0]), html('small', {}, kind[1])), html('span', { class: 'end' }, ...textNodes(sizeWords(row.size_bytes))));
    if (!why) listen(asItIs, 'click', () => setTimeout(() => this.#dialog.close()));
    const made = row.state === 'read' ? (this.#model.listing.formats ?? []).filter(({ name, ros_version }) => name !== row.format && (ros_version === null || ros_version === row.ros_version)) : [];
    this.#dialog.show(`Download ${name}`, [html('p', { class: 'sub' }, 'Other formats are made on request.')], [html('ul', { class: 'menu-list' }, html('li', {}, asItIs),
      ...made.map(({ name: format, label, use }) => {
        const key = html('button', { type: 'button', 'data-format': format, 'data-operator': true }, icon('download'), html('span', { class: 'tx' }, html('b', {}, label), html('small', {}, use)));
        listen(key, 'click', () => this.#make(row, format, label, back));
        return html('li', {}, key);
      }))], [this.#dialog.key('Back', back)]);
  }

  /** @param {Recording} row @param {string} format @param {string} label @param {() => void} back */
  async #make(row, format, label, back) {
    const job = new FileJob(addressOf(row.id, '/exports'), { format }, (job) => bar.update(job));
    const bar = this.#progress(`Preparing the ${label}`, job);
    const over = await job.run();
    if (this.#job !== job || !this.#dialog.isOpen) return;
    if (over.state === 'done') {
      save(job.address);
      this.#dialog.show(`${label} of ${nameOf(row, Date.now())}`, [html('p', { role: 'status' }, `Done. It is in this device’s downloads.${over.is_whole === false ? ' The export is incomplete:' : ''}`), ...(over.notes ?? []).map((note) => html('p', {}, ...textNodes(note)))], [], [this.#dialog.key('Save again', () => save(job.address)), this.#dialog.key('Back', () => this.download(row, back))]);
    } else if (over.state === 'cancelled') this.download(row, back);
    else this.#dialog.refuse('Not made', over.sentence ?? 'The server could not prepare it.', back);
  }

  /** @param {string} title @param {FileJob} job */
  #progress(title, job) {
    this.#job?.giveUp();
    this.#job = job;
    const bar = /** @type {HTMLProgressElement} */ (html('progress', { max: 1, value: 0, 'aria-label': title }));
    const status = html('p', { role: 'status' });
    setSentence(status, 'The server is starting.');
    this.#dialog.show(title, [], [html('div', { class: 'progress' }, bar, status)], [this.#dialog.key('Cancel', () => job.giveUp())]);
    return {
      /** @param {import('./files-job.js').Job} job */
      update: ({ progress, sentence }) => {
        if (progress !== null) bar.value = progress;
        setSentence(status, sentence ?? `${Math.round((progress ?? 0) * 100)} % done.`);
      },
    };
  }

  /** The alarms that were raised in a recording. @param {Recording} row @returns {Promise<NonNullable<Recording['raised']>>} */
  async raised(row) {
    const whole = /** @type {Recording} */ (await request(addressOf(row.id)));
    return ranked(whole.raised ?? []);
  }

  /** The alarms of a recording, to cut out the time around one. @param {Recording} row @param {() => void} back */
  async incidents(row, back) {
    let raised;
    try {
      raised = await this.raised(row);
    } catch (error) {
      this.#dialog.refuse('Not fetched', sentenceOf(error), back);
      return;
    }
    this.#dialog.show('Cut out an incident', [html('p', { class: 'sub' }, ...textNodes(raised.length ? `From ${CLIP_S} s before an alarm to ${CLIP_S} s after it, as a separate recording.` : 'No alarm was raised in this recording.'))],
      [html('ul', { class: 'menu-list' }, ...raised.map((alarm) => {
        const key = html('button', { type: 'button' }, icon(ICONS[alarm.priority], alarm.priority === 'critical' ? 'c-crit' : alarm.priority === 'warning' ? 'c-warn' : ''),
          html('span', { class: 'tx' }, html('b', {}, ...textNodes(alarm.title)), html('small', {}, ...textNodes(alarm.text))), html('span', { class: 'end n' }, timeOfDay(alarm.at_ms)));
        listen(key, 'click', () => this.#cut(row, alarm.at_ms, back));
        return html('li', {}, key);
      }))], [this.#dialog.key('Back', back)]);
  }

  /** @param {Recording} row @param {number} at_ms @param {() => void} back */
  async #cut(row, at_ms, back) {
    const job = new FileJob(addressOf(row.id, '/clip'), { at_ms, before_s: CLIP_S, after_s: CLIP_S }, (job) => bar.update(job));
    const bar = this.#progress('Cutting out the incident', job);
    const over = await job.run();
    if (this.#job !== job || !this.#dialog.isOpen) return;
    if (over.state === 'done') {
      await this.#model.refresh();
      const made = this.#model.rows.find(({ id }) => id === over.recording);
      if (made) this.#open(made);
      else this.#dialog.close();
      this.#say('The clip is in the list as its own recording.', 'Incident cut out');
    } else if (over.state === 'cancelled') back();
    else this.#dialog.refuse('Not cut out', over.sentence ?? 'The server could not prepare it.', back);
  }
}
