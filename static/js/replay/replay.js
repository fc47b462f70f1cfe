// Replay: the page turned to a recording, and back. Whatever draws live draws this; here are its band, its ways in and out,
// and the alarms of the live car meanwhile.

import { field, html, icon, listen, need, setAttribute, setText, setSentence } from '../core/dom.js';
import { ReplayBand, liveSheet } from './replay-band.js';
import { JumpList } from './replay-jumps.js';
import { joinedChoices, sketchOf, summaryOf, tapeWords } from './replay-layout.js';
import { Scrubber } from './replay-scrubber.js';
import { request } from '../control/request.js';
import { fetchStyle, styled } from '../core/style-sheet.js';
import { addressOf } from '../files/files-model.js';
import { ReplayLead } from './replay-lead.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {(sentence: string, title?: string) => void} Say
 * @typedef {import('./replay-layout.js').Change} Change
 * @typedef {import('./replay-lead.js').Order} Order
 * @typedef {import('./replay-lead.js').Outcome} Outcome
 */

/** A long file that was never closed is read through before it is shown [ms]. */
const OPENS_MS = 25_000;
/** A connection that breaks meanwhile is waited for so often. */
const TRIES = 3;
/** An id of the catalog. */
const ID = /^[\w-]+$/;
/** What is shown first. */
const HOME = '#home';
/** The address follows the moment so often; browsers allow no more [ms]. */
const NOTE_MS = 2000;
const OVER = { ok: false, reason: 'This replay is over.' };
/** An agent of an older version tells less. */
const NO_EVENTS = { flags: [], interventions: [], modes: [] };

/** @type {Replay | null} */
let current = null;

/**
 * Show a recording in this page, Home first. What is live goes on, covered, until it is there.
 * @param {string} id
 * @param {Store} store
 * @param {Say} say
 * @param {{at_s?: number, staysOnTab?: boolean}} [where] at_s: seconds since its beginning; staysOnTab: the address named a tab
 * @returns {Promise<boolean>} whether it is shown
 */
export async function openReplay(id, store, say, { at_s = 0, staysOnTab = false } = {}) {
  await fetchStyle('/static/css/replay.css');
  const opening = store.replaying || current ? null : new Replay(id, store, say);
  if (!opening) say('Opening…');
  current ??= opening;
  let answer = await store.ask('replay', { do: 'open', recording: id, at_s }, OPENS_MS);
  for (let tries = 1; answer.isBroken && tries < TRIES; tries += 1) {
    if (!store.sync.hasGreeted) await opened(store); // else another connection has taken its place already
    answer = await store.ask('replay', { do: 'open', recording: id, at_s }, OPENS_MS);
  }
  if (!answer.ok) {
    if (current === opening) opening?.giveUp();
    say(answer.reason ?? 'Refused.', 'Not replayed');
    return false;
  }
  if (opening && current !== opening) {
    void store.ask('replay', { do: 'leave' }); // the person left before it was open
    return false;
  }
  if (!opening) {
    current?.unmount();
    current = new Replay(id, store, say);
  }
  store.replaying = true;
  current?.begin();
  for (const note of document.querySelectorAll('.snack.note')) note.remove();
  if (!staysOnTab && location.hash !== HOME) location.hash = HOME;
  return true;
}

/**
 * Judge the recording that is shown by other topics or units, from the same moment on.
 * @param {Change} change
 * @returns {Promise<{ok: boolean, reason?: string}>}
 */
export async function judgeBy(change) {
  return current?.judgeBy(change) ?? OVER;
}

/**
 * Lead the recording that is shown. While its connection is opened again, the order waits until the recording is.
 * @param {Order} order
 * @returns {Promise<Outcome>}
 */
export async function lead(order) {
  return current?.leader.order(order) ?? OVER;
}

/** The time line of the recording that is shown, as far as it is made. */
export const recordedLine = () => current?.line ?? null;

/** @param {Store} store @returns {Promise<void>} once the server greets again */
function opened(store) {
  return new Promise((resolve) => {
    const stop = store.on('open', () => {
      stop();
      resolve();
    });
  });
}

class Replay {
  /** The server has not opened it yet: what is live goes on, covered. */
  #isOpening = true;
  #noted_ms = -Infinity;
  #isLeaving = false;
  /** The occurrence of a live alarm that was seen and stayed away from. */
  #seen = '';
  /** How it ran, for a socket that breaks. */
  #ran = { is_playing: false, rate: 1, at_s: 0 };
  parts = build();
  band = new ReplayBand();
  sheet = liveSheet();
  /** The time line as far as it is made. @type {import('../core/protocol-types.js').Timeline | null} */
  line = null;

  /**
   * @param {string} id
   * @param {Store} store
   * @param {Say} say
   */
  constructor(id, store, say) {
    this.id = id;
    this.store = store;
    store.judgedBy = { topics: {}, units: {} };
    this.say = say;
    this.board = need(document, '#monitor');
    this.root = document.documentElement;
    this.leader = new ReplayLead(store);
    setAttribute(this.root, 'data-replay', 'opening');
    need(this.board, '.top').prepend(this.parts.top);
    need(this.board, '.strip').after(this.band.element);
    document.body.append(this.sheet);
    this.scrubber = new Scrubber(store, this.leader, say);
    this.jumps = new JumpList((at_s) => this.scrubber.seek(at_s));
    need(this.board, '.view').after(this.scrubber.element);
    this.stops = [
      store.on('draw', () => this.#draw()),
      store.on('tick', () => document.hidden && this.#aside()),
      store.on('beat', () => this.#beat()),
      store.on('open', () => this.#again()),
      store.on('replay', (message) => this.#received(message)),
      listen(this.scrubber.leave, 'click', () => this.leave()),
      listen(this.band.live, 'click', () => this.leave()),
      listen(this.parts.compare, 'click', () => this.#chooseSecond()),
      listen(this.band.moment, 'click', () => this.#openJumps()),
      listen(field(this.sheet, 'back'), 'click', () => this.leave()),
      listen(field(this.sheet, 'stay'), 'click', () => this.sheet.close()),
      listen(document, 'keydown', (event) => this.scrubber.key(event)),
    ];
    void this.#sketch();
    void this.#fetchMarks();
    this.#aside();
  }

  /** What people marked: flags on the time line, and a card at each moment. Without them it is replayed all the same. */
  async #fetchMarks() {
    if (!ID.test(this.id)) return;
    try {
      const { MarkCard, marksOf } = await import('../drive/recorded-marks.js');
      const [marks] = await Promise.all([marksOf(this.id), styled('drive')]);
      if (current !== this || !marks.length) return;
      const card = new MarkCard(this.id, this.say);
      need(this.board, ':scope > .view').append(card.element);
      this.scrubber.flag(marks);
      this.stops.push(this.store.on('draw', () => card.draw(marks, this.store.frame?.replay?.at_s ?? -1)), () => card.stop(), () => card.element.remove());
    } catch (error) {
      console.info('Marks of the recording:', error);
    }
  }

  /** The server has opened it. */
  begin() {
    this.#isOpening = false;
    this.#note(true);
    this.#draw();
  }

  /** It is not shown after all. */
  giveUp() {
    this.unmount();
    setAttribute(this.root, 'data-replay', null);
  }

  /** What the catalog knows of it stands until the server has read the recording. */
  async #sketch() {
    const row = ID.test(this.id) ? await request(addressOf(this.id)).catch(() => null) : null;
    if (!row || !this.#isOpening || current !== this) return;
    this.band.sketch(row);
    const line = sketchOf(row);
    if (line) this.#received(line);
  }

  /** Back to live, with one tap. @param {string} [why] shown, where the replay ended by itself */
  async leave(why) {
    if (this.#isLeaving) return;
    this.#isLeaving = true;
    if (this.#isOpening) {
      this.giveUp();
      return;
    }
    if (why === undefined && this.store.socket.isOpen) {
      const answer = await this.store.ask('replay', { do: 'leave' });
      if (!answer.ok && !answer.isBroken) {
        this.#isLeaving = false;
        this.say(answer.reason ?? 'Refused.', 'Still in the replay');
        return;
      }
    }
    this.unmount();
    this.store.replaying = false;
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
    this.jumps.unmount();
    if (this.sheet.open) this.sheet.close();
    for (const part of [this.parts.top, this.band.element, this.sheet]) part.remove();
    if (current === this) current = null;
    this.leader.end();
  }

  #beat() {
    const { replay } = this.store.frame ?? {};
    if (this.#isOpening) this.#aside();
    if (!replay) return;
    setAttribute(this.root, 'data-replay', 'on');
    this.#ran = { is_playing: replay.is_playing, rate: replay.rate, at_s: replay.at_s };
    this.#note();
    this.#aside();
  }

  /** The socket is there again: back to the moment, and on as it ran. Until then nothing live is shown as recorded. */
  async #again() {
    if (this.#isOpening || this.#isLeaving) return; // the new connection shows what is live
    const answer = await this.#reopen(this.store.judgedBy);
    if (current === this && !answer.ok && !answer.isBroken) void this.leave(answer.reason ?? 'Refused.');
  }

  /** @param {Change} change */
  async judgeBy(change) {
    const choices = joinedChoices(this.store.judgedBy, change);
    const answer = await this.#reopen(choices);
    if (answer.ok && current === this) this.store.judgedBy = choices;
    return answer;
  }

  /** Open it at the moment where it was, and on as it ran. @param {{topics: Record<string, string>, units: Record<string, string>}} choices */
  async #reopen(choices) {
    const { is_playing, rate, at_s } = this.#ran;
    const { store } = this;
    return this.leader.reopen(async () => {
      const answer = await store.ask('replay', { do: 'open', recording: this.id, at_s, ...choices }, OPENS_MS);
      if (current !== this || !answer.ok) return answer;
      if (rate !== 1) void store.ask('replay', { do: 'rate', rate });
      if (is_playing) void store.ask('replay', { do: 'play' });
      return answer;
    });
  }

  /** @param {any} message */
  #received(message) {
    if (message.kind === 'replay') {
      void this.leave(message.ended);
      return;
    }
    if (message.kind !== 'timeline') return;
    const line = { ...NO_EVENTS, ...message };
    this.line = line;
    this.scrubber.take(line);
    this.jumps.take(line);
  }

  /** A second recording is chosen among the files. */
  #chooseSecond() {
    location.hash = '#files';
    this.say('Choose the recording to compare.', 'Compare');
  }

  #openJumps() {
    const replay = this.store.frame?.replay;
    if (replay) this.jumps.open(replay);
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
    this.band.draw(frame, this.line);
    setText(this.parts.length, tapeWords(frame.replay));
    this.scrubber.draw(frame);
  }

  /** What of the live car needs the operator: a key on the band, and for what is critical and not acknowledged a dialog. */
  #aside() {
    const { frame } = this.store;
    if (!frame) return;
    const { sheet } = this;
    const asking = this.band.drawLive(frame.replay ? frame.live : summaryOf(frame));
    if (!frame.replay) return; // then the live alarm has its own dialog
    const key = asking ? `${asking.id} ${asking.occurrence}` : '';
    if (!asking) {
      if (sheet.open) sheet.close();
      this.#seen = '';
      return;
    }
    setSentence(field(sheet, 'title'), `Live: ${asking.title}`);
    setSentence(field(sheet, 'text'), asking.text);
    if (key === this.#seen) return;
    this.#seen = key;
    if (!sheet.open) sheet.showModal();
    field(sheet, 'back').focus();
  }
}

/** What a replay puts into the bar. */
function build() {
  const length = html('span', { class: 'n' });
  const compare = html('button', { type: 'button', class: 'key wide compare-key' }, 'Compare');
  return { length, compare, top: html('div', { class: 'replay-top' }, html('b', {}, icon('replay'), 'REPLAY'), length, compare) };
}
