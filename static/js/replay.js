// Replay: the page turned to a recording, and back. Whatever draws live draws this; here are its band, its ways in and out,
// and what must be heard of the live car meanwhile.

import { field, html, icon, listen, need, setAttribute, setIcon, setText, setWords, show } from './dom.js';
import { asideOf, dateOf, toldOf } from './replay-layout.js';
import { Scrubber } from './replay-scrubber.js';
import { timeOfDay } from './words.js';

/**
 * @typedef {import('./store.js').Store} Store
 * @typedef {(sentence: string, title?: string) => void} Say
 */

/** A long file that was never closed is read through before it is shown [ms]. */
const OPENS_MS = 25_000;
/** A connection that breaks meanwhile is waited for so often. */
const TRIES = 3;
/** The address follows the moment so often; browsers allow no more [ms]. */
const NOTE_MS = 2000;

/** @type {Replay | null} */
let current = null;

/**
 * Show a recording in this page. What is live goes on until it is there.
 * @param {string} id
 * @param {Store} store
 * @param {Say} say
 * @param {number} [at_s] seconds since its beginning
 * @returns {Promise<boolean>} whether it is shown
 */
export async function openReplay(id, store, say, at_s = 0) {
  await styled();
  say('Opening…');
  let answer = await store.ask('replay', { do: 'open', recording: id, at_s }, OPENS_MS);
  for (let tries = 1; !answer.ok && !store.wire.isOpen && tries < TRIES; tries += 1) {
    await opened(store); // the connection broke meanwhile: nobody refused
    answer = await store.ask('replay', { do: 'open', recording: id, at_s }, OPENS_MS);
  }
  if (!answer.ok) {
    say(answer.reason ?? 'Refused.', 'Not replayed');
    return false;
  }
  current?.unmount();
  store.turn(true);
  current = new Replay(id, store, say);
  for (const note of document.querySelectorAll('.snack.note')) note.remove();
  return true;
}

/** @param {Store} store @returns {Promise<void>} once the server greets again */
function opened(store) {
  return new Promise((resolve) => {
    const stop = store.on('open', () => {
      stop();
      resolve();
    });
  });
}

/** The style sheet of a replay is fetched with the first one. @returns {Promise<void>} */
function styled() {
  const sheet = document.querySelector('link[data-replay]');
  if (sheet) return Promise.resolve();
  const link = /** @type {HTMLLinkElement} */ (html('link', { rel: 'stylesheet', href: '/static/css/replay.css', 'data-replay': true }));
  return new Promise((resolve, reject) => {
    link.onload = () => resolve();
    link.onerror = () => {
      link.remove();
      reject(new Error('The style sheet of the replay could not be fetched'));
    };
    document.head.append(link);
  });
}

class Replay {
  #noted_ms = -Infinity;
  #isLeaving = false;
  /** The occurrence of a live alarm that was seen and stayed away from. */
  #seen = '';
  /** How it ran, for a socket that breaks. */
  #ran = { is_playing: false, rate: 1, at_s: 0 };
  parts = build();

  /**
   * @param {string} id
   * @param {Store} store
   * @param {Say} say
   */
  constructor(id, store, say) {
    this.id = id;
    this.store = store;
    this.say = say;
    this.board = need(document, '#monitor');
    this.root = document.documentElement;
    setAttribute(this.root, 'data-replay', 'opening');
    need(this.board, '.top').prepend(this.parts.top);
    need(this.board, '.strip').after(this.parts.band);
    this.board.append(this.parts.tape);
    document.body.append(this.parts.sheet);
    this.scrubber = new Scrubber(store, say);
    need(this.board, '.view').after(this.scrubber.element);
    this.stops = [
      store.on('draw', () => this.#draw()),
      store.on('tick', () => document.hidden && this.#aside()),
      store.on('beat', () => this.#beat()),
      store.on('open', () => this.#again()),
      store.on('replay', (message) => this.#told(message)),
      listen(this.parts.leave, 'click', () => this.leave()),
      listen(this.parts.live, 'click', () => this.leave()),
      listen(field(this.parts.sheet, 'back'), 'click', () => this.leave()),
      listen(field(this.parts.sheet, 'stay'), 'click', () => this.parts.sheet.close()),
      listen(document, 'keydown', (event) => this.scrubber.key(event)),
    ];
    this.#note(true);
    this.#draw();
  }

  /** Back to live, with one tap. @param {string} [why] said, where the replay ended by itself */
  async leave(why) {
    if (this.#isLeaving) return;
    this.#isLeaving = true;
    if (why === undefined && this.store.wire.isOpen) {
      const answer = await this.store.ask('replay', { do: 'leave' });
      if (!answer.ok && this.store.wire.isOpen) {
        this.#isLeaving = false;
        this.say(answer.reason ?? 'Refused.', 'Still in the replay');
        return;
      }
    }
    this.unmount();
    this.store.turn(false);
    const url = new URL(location.href);
    url.searchParams.delete('replay');
    url.searchParams.delete('t');
    history.replaceState(history.state, '', url);
    setAttribute(this.root, 'data-replay', 'leaving'); // until the first live frame, nothing recorded looks live
    const stop = this.store.on('beat', () => {
      stop();
      if (!current) setAttribute(this.root, 'data-replay', null);
    });
    if (why !== undefined) this.say(why, 'Replay ended');
  }

  unmount() {
    for (const stop of this.stops) stop();
    this.scrubber.unmount();
    const { top, band, tape, sheet } = this.parts;
    if (sheet.open) sheet.close();
    for (const part of [top, band, tape, sheet]) part.remove();
    if (current === this) current = null;
  }

  #beat() {
    const { replay } = this.store.frame ?? {};
    if (!replay) return;
    setAttribute(this.root, 'data-replay', 'on');
    this.#ran = { is_playing: replay.is_playing, rate: replay.rate, at_s: replay.at_s };
    this.#note();
    this.#aside();
  }

  /** The socket is there again: back to the moment, and on as it ran. Until then nothing live is shown as recorded. */
  async #again() {
    const { is_playing, rate, at_s } = this.#ran;
    const { store } = this;
    const answer = await store.ask('replay', { do: 'open', recording: this.id, at_s }, OPENS_MS);
    if (current !== this || !answer.ok) {
      if (current === this && store.wire.isOpen) void this.leave(answer.reason ?? 'Refused.');
      return;
    }
    if (rate !== 1) void store.ask('replay', { do: 'rate', rate });
    if (is_playing) void store.ask('replay', { do: 'play' });
  }

  /** @param {any} message */
  #told(message) {
    if (message.kind === 'replay') void this.leave(message.ended);
    else this.scrubber.take(message);
  }

  /** The address leads back here. @param {boolean} [isNow] */
  #note(isNow = false) {
    const at_s = this.store.frame?.replay?.at_s ?? 0;
    if (!isNow && this.store.now() - this.#noted_ms < NOTE_MS) return;
    this.#noted_ms = this.store.now();
    const url = new URL(location.href);
    url.searchParams.set('replay', this.id);
    if (this.store.frame?.replay) url.searchParams.set('t', at_s.toFixed(1));
    if (url.href !== location.href) history.replaceState(history.state, '', url);
  }

  #draw() {
    const { frame } = this.store;
    if (!frame?.replay) return;
    const { date, time, line, mark, text, end } = this.parts;
    setWords(date, `Recorded ${dateOf(frame.replay.at_ms)}`);
    setText(time, timeOfDay(frame.replay.at_ms));
    const told = toldOf(frame);
    setAttribute(line, 'data-kind', told.kind || null);
    setIcon(mark, told.icon);
    setWords(text, told.text);
    setWords(end, told.end);
    this.scrubber.draw(frame);
  }

  /** What is live and must be heard: a key on the band, and for what is critical and not acknowledged a dialog. */
  #aside() {
    const { frame } = this.store;
    if (!frame?.replay) return;
    const { live, liveText, sheet } = this.parts;
    const aside = asideOf(frame.live);
    show(live, aside !== null);
    if (aside) {
      setAttribute(live, 'data-kind', aside.kind);
      setWords(liveText, aside.text);
    }
    const asking = aside?.asking ?? null;
    const key = asking ? `${asking.id} ${asking.occurrence}` : '';
    if (!asking) {
      if (sheet.open) sheet.close();
      this.#seen = '';
      return;
    }
    setWords(field(sheet, 'title'), `Live: ${asking.title}`);
    setWords(field(sheet, 'text'), asking.text);
    if (key === this.#seen) return;
    this.#seen = key;
    if (!sheet.open) sheet.showModal();
    field(sheet, 'back').focus();
  }
}

/** What a replay adds to the page: bar, band, edges, and the dialog of a live alarm. */
function build() {
  const leave = html('button', { type: 'button', class: 'key leave' }, icon('close'), 'Leave');
  const date = html('span', { class: 'text' });
  const time = html('span', { class: 'n end' });
  const mark = icon('ok', 's');
  const text = html('span', { class: 'text' });
  const end = html('span', { class: 'end' });
  const line = html('div', { class: 'replay-line' }, mark, text, end);
  const liveText = html('b', { class: 'text' });
  const live = html('button', { type: 'button', class: 'replay-live', hidden: true }, icon('bell', 's'), liveText, html('span', { class: 'end' }, 'Back to live'));
  const sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet crit', id: 'sheet-live', role: 'alertdialog', 'aria-labelledby': 'live-title', 'aria-describedby': 'live-words', 'data-priority': 'critical' },
    html('h2', {}, icon('crit'), html('span', { id: 'live-title', 'data-f': 'title' })),
    html('div', { class: 'bd', id: 'live-words' }, html('p', { 'data-f': 'text' }), html('p', { class: 'sub' }, 'This is happening now. The page behind shows a recording.')),
    html('div', { class: 'keys' }, html('button', { type: 'button', class: 'main', 'data-f': 'back' }, 'Back to live'), html('button', { type: 'button', class: 'key', 'data-f': 'stay' }, 'Stay in the replay'))));
  return {
    leave, date, time, mark, text, end, line, live, liveText, sheet,
    top: html('div', { class: 'replay-top' }, html('b', {}, icon('replay'), 'REPLAY'), leave),
    band: html('section', { class: 'replay-band', 'aria-label': 'Replay of a recording' }, html('div', { class: 'replay-date' }, icon('files', 's'), date, time), line, live),
    tape: html('div', { class: 'replay-tape', 'aria-hidden': 'true' }),
  };
}
