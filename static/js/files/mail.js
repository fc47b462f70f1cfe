// The e-mail sheet: recordings to somebody, by this server's mail, or by the mail program of the phone.

import { FileJob } from './files-job.js';
import { request, sentenceOf } from '../control/request.js';
import { keptAt } from '../core/kept-at.js';
import { html, icon, listen, setAttribute, setText, setSentence, show, textNodes } from '../core/dom.js';
import { FORMATS, KINDS, mailtoOf, pathOf, recipientProblem, recipientsOf, sizeNote } from './mail-layout.js';
import { styled } from '../core/style-sheet.js';
import { openOutbox } from './outbox.js';
import { addSheet, closeSheet, openSheet } from '../shell/sheet.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('./mail-layout.js').MailFormat} MailFormat
 * @typedef {(sentence: string, title?: string, way?: import('../shell/notice.js').Way) => void} Say
 */

const KEPT = 'catgraph.mail-to';
/** Held in the phone's memory while it is handed to its mail program. */
const MOST_SHARED = 100_000_000;

/** @type {MailSheet | null} */
let sheet = null;

/**
 * Opens the sheet for these recordings. What was typed for the same ones, when an alarm closed it, is still there.
 * @param {string[]} recordingIds
 * @param {Store} store
 * @param {Say} say
 */
export async function openMail(recordingIds, store, say) {
  await styled('mail');
  sheet ??= new MailSheet(store, say);
  await sheet.open(recordingIds);
}

class MailSheet {
  /** @type {string[]} */
  #ids = [];
  /** @type {MailFormat} */
  #format = 'mcap';
  /** @type {'split' | 'link'} */
  #tooLarge = 'split';
  /** What the recordings have together; null: not known. @type {number | null} */
  #bytes = null;
  #limit_mb = 18;
  #isSetUp = true;
  /** One order, however often the answer is lost on its way. */
  #key = '';
  /** @type {FileJob | null} */
  #job = null;
  /** What the phone can be handed at the next press. @type {File | null} */
  #file = null;

  /** @param {Store} store @param {Say} say */
  constructor(store, say) {
    this.store = store;
    this.say = say;
    this.about = html('p', { class: 'sub', id: 'mail-about', dir: 'auto' });
    this.to = /** @type {HTMLInputElement} */ (html('input', { id: 'mail-to', type: 'text', inputmode: 'email', autocomplete: 'email', autocapitalize: 'off', autocorrect: 'off', spellcheck: 'false', maxlength: 2000, placeholder: 'ann@example.org, bob@example.org', 'aria-describedby': 'mail-refused' }));
    this.subject = /** @type {HTMLInputElement} */ (html('input', { id: 'mail-subject', type: 'text', maxlength: 200, autocomplete: 'off' }));
    this.text = /** @type {HTMLTextAreaElement} */ (html('textarea', { id: 'mail-text', maxlength: 20_000, rows: 3 }));
    this.formats = FORMATS.map(([name, label]) => html('button', { type: 'button', 'data-format': name, 'aria-pressed': 'false' }, label));
    this.formatHint = html('p', { class: 'mail-hint' });
    this.ways = [html('button', { type: 'button', 'data-way': 'split', 'aria-pressed': 'false' }, 'Parts'), html('button', { type: 'button', 'data-way': 'link', 'aria-pressed': 'false' }, 'A link')];
    this.size = html('p', { class: 'mail-hint', 'data-f': 'mail-size' });
    this.refused = html('p', { class: 'bad', role: 'alert', id: 'mail-refused' });
    this.status = html('p', { class: 'good', role: 'status' });
    this.limit = html('span', { class: 'lab', id: 'mail-way-lab' });
    this.send = html('button', { type: 'button', class: 'main', 'data-f': 'mail-send' }, 'Send');
    this.own = html('button', { type: 'button', class: 'key wide', 'data-f': 'mail-own' }, icon('share'), html('span', {}, 'Open in my mail app'));
    this.outbox = html('button', { type: 'button', class: 'key', 'data-f': 'mail-outbox' }, 'Outbox');
    const close = html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close');
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed mail-sheet', id: 'sheet-mail', 'aria-labelledby': 'mail-title', 'aria-describedby': 'mail-about' },
      html('div', { class: 'bd' }, html('h2', { id: 'mail-title' }, icon('mail'), 'E-mail'), this.about),
      html('div', { class: 'what' }, html('div', { class: 'mail-form' },
        html('label', { for: 'mail-to' }, 'To'), this.to,
        html('label', { for: 'mail-subject' }, 'Subject'), this.subject,
        html('label', { for: 'mail-text' }, 'Message'), this.text,
        html('span', { class: 'lab', id: 'mail-format-lab' }, 'Format'),
        html('div', { class: 'seg', role: 'group', 'aria-labelledby': 'mail-format-lab' }, ...this.formats), this.formatHint,
        this.limit, html('div', { class: 'seg', role: 'group', 'aria-labelledby': 'mail-way-lab' }, ...this.ways), this.size)),
      html('div', { class: 'mail-form' }, this.refused, this.status),
      html('div', { class: 'keys' }, this.send, this.own, html('div', { class: 'pair' }, this.outbox, close))));
    addSheet(this.sheet);
    this.#listen();
  }

  #listen() {
    for (const key of this.formats) {
      listen(key, 'click', () => {
        this.#format = /** @type {MailFormat} */ (key.dataset['format']);
        this.#changed();
      });
    }
    for (const key of this.ways) {
      listen(key, 'click', () => {
        this.#tooLarge = key.dataset['way'] === 'link' ? 'link' : 'split';
        this.#changed();
      });
    }
    for (const one of [this.to, this.subject, this.text]) listen(one, 'input', () => this.#changed());
    listen(this.send, 'click', () => this.#send());
    listen(this.own, 'click', () => this.#own());
    listen(this.outbox, 'click', () => openOutbox(this.say));
    listen(this.sheet, 'close', () => this.#job?.giveUp());
  }

  /** @param {string[]} ids */
  async open(ids) {
    const isSame = ids.join() === this.#ids.join();
    this.#ids = ids;
    if (!isSame) {
      this.#bytes = null;
      this.to.value = kept();
      this.subject.value = '';
      this.text.value = '';
      setText(this.about, ids.length === 1 ? ids[0] ?? '' : `${ids.length} recordings`);
    }
    this.#changed();
    openSheet(this.sheet);
    await this.#look();
    if (!isSame && this.subject.value === '') this.subject.value = this.about.textContent?.startsWith('Recording') ? this.about.textContent : `Recording ${this.about.textContent}`;
  }

  /** What the server knows: how large it is, where the limit lies, and whether it can send at all. */
  async #look() {
    const ids = this.#ids;
    const [settings, ...rows] = await Promise.all([
      request('/api/mail/settings').catch((error) => sentenceOf(error)),
      ...ids.map((id) => request(`/api/recordings/${encodeURIComponent(id)}`).catch(() => null)),
    ]);
    if (ids !== this.#ids) return;
    this.#bytes = rows.every((row) => typeof row?.size_bytes === 'number') ? rows.reduce((sum, row) => sum + row.size_bytes, 0) : null;
    const title = rows.length === 1 && typeof rows[0]?.title === 'string' && rows[0].title ? rows[0].title : null;
    if (title) setText(this.about, title);
    this.#isSetUp = typeof settings === 'object' && settings.is_complete;
    if (typeof settings === 'object') this.#limit_mb = settings.limit_mb;
    setSentence(this.refused, typeof settings === 'string' ? settings : settings.is_complete ? '' : 'E-mail is not set up on this server: see Settings, E-mail.');
    this.#draw();
  }

  /** Counts the requests: an answer for another mail is dropped. */
  #changed() {
    this.#key = newKey();
    this.#file = null;
    this.#job?.giveUp();
    setText(this.status, '');
    if (this.#isSetUp) setText(this.refused, '');
    setAttribute(this.to, 'aria-invalid', null);
    setText(/** @type {HTMLElement} */ (this.own.lastElementChild), 'Open in my mail app');
    this.#draw();
  }

  #draw() {
    for (const key of this.formats) key.setAttribute('aria-pressed', String(key.dataset['format'] === this.#format));
    for (const key of this.ways) key.setAttribute('aria-pressed', String(key.dataset['way'] === this.#tooLarge));
    setText(this.formatHint, FORMATS.find(([name]) => name === this.#format)?.[2] ?? '');
    this.limit.replaceChildren(...textNodes(`Above ${this.#limit_mb} MB`));
    setSentence(this.size, sizeNote(this.#format === 'mcap' ? this.#bytes : null, this.#limit_mb, this.#tooLarge));
    setAttribute(this.send, 'disabled', !this.#isSetUp);
  }

  async #send() {
    const to = recipientsOf(this.to.value);
    const problem = recipientProblem(to);
    if (problem) {
      this.#refuse(problem, this.to);
      return;
    }
    setAttribute(this.send, 'disabled', true);
    setSentence(this.status, 'Sending to the server…');
    try {
      await request('/api/mail', { method: 'POST', body: { recordings: this.#ids, format: this.#format, to, subject: this.subject.value.trim(), text: this.text.value, too_large: this.#tooLarge, key: this.#key } });
      keep(to.join(', '));
      this.#ids = [];
      closeSheet(this.sheet);
      this.say('It stays in the outbox until the mail server accepts it.', 'E-mail queued', { label: 'Outbox', act: () => openOutbox(this.say) });
    } catch (error) {
      setText(this.status, '');
      this.#refuse(sentenceOf(error), null);
    }
    setAttribute(this.send, 'disabled', !this.#isSetUp);
  }

  /** @param {string} sentence @param {HTMLElement | null} at fault */
  #refuse(sentence, at) {
    setSentence(this.refused, sentence);
    if (!at) return;
    setAttribute(at, 'aria-invalid', 'true');
    at.focus();
  }

  /** Shares the file where this phone can share such files, else opens a mail with links. */
  async #own() {
    setText(this.refused, '');
    if (this.#file) {
      await this.#hand(this.#file);
      return;
    }
    const [ending, type] = KINDS[this.#format];
    const id = this.#ids[0] ?? '';
    const trial = new File([new Uint8Array(1)], `${id}.${ending}`, { type });
    const isSmall = this.#bytes !== null && this.#bytes <= MOST_SHARED;
    if (this.#ids.length !== 1 || !isSmall || !navigator.canShare?.({ files: [trial] })) {
      this.#mailto();
      return;
    }
    try {
      const address = this.#format === 'mcap' ? keptAt(pathOf(id, 'mcap')) : await this.#made(id);
      if (address === null) return;
      setSentence(this.status, 'Loading from the server…');
      const answer = await fetch(address);
      if (!answer.ok) throw new Error('It could not be loaded from the server. Try again.');
      this.#file = new File([await answer.blob()], `${id}.${ending}`, { type });
      setSentence(this.status, 'Ready. Press again: the device opens the file only after a press.');
      setText(/** @type {HTMLElement} */ (this.own.lastElementChild), 'Open it in my mail app');
    } catch (error) {
      setText(this.status, '');
      this.#refuse(sentenceOf(error), null);
    }
  }

  /** Where the server has made it in the format; null: it was given up. @param {string} id */
  async #made(id) {
    this.#job?.giveUp();
    const job = new FileJob(`/api/recordings/${encodeURIComponent(id)}/exports`, { format: this.#format }, ({ progress }) => setSentence(this.status, `The server is preparing it${progress === null ? '' : `: ${Math.round(progress * 100)} %`}.`));
    this.#job = job;
    const ended = await job.run();
    if (ended.state === 'failed') throw new Error(ended.sentence ?? 'The server could not prepare it.');
    return ended.state === 'done' ? job.address : null;
  }

  /** @param {File} file */
  async #hand(file) {
    try {
      await navigator.share({ title: this.subject.value, text: this.text.value, files: [file] });
      closeSheet(this.sheet);
    } catch (error) {
      if (error instanceof DOMException && error.name === 'AbortError') return; // the operator thought better of it
      this.#mailto();
    }
  }

  #mailto() {
    const links = this.#ids.map((id) => new URL(keptAt(pathOf(id, this.#format)), location.href).href);
    const link = html('a', { href: mailtoOf({ to: recipientsOf(this.to.value), subject: this.subject.value, text: this.text.value, links }) });
    setSentence(this.status, 'Your mail app gets links, because this device cannot share files with it. The links work for anyone who can reach this server.');
    link.click();
  }
}

function newKey() {
  return [...crypto.getRandomValues(new Uint8Array(12))].map((byte) => byte.toString(16).padStart(2, '0')).join('');
}

/** Whom the last mail of this phone went to. */
function kept() {
  try {
    return localStorage.getItem(KEPT) ?? '';
  } catch {
    return '';
  }
}

/** @param {string} to */
function keep(to) {
  try {
    localStorage.setItem(KEPT, to);
  } catch {
    // no storage: it is typed again
  }
}
