// What the page knows: the newest frame, how old it is, the log of events; and the way to ask the server for something.

import { ServerClock } from './clock.js';
import { DeadMan } from './dead-man.js';
import { Emitter } from './emitter.js';
import { EventLog } from './event-log.js';
import { freshnessStyle } from './freshness.js';
import { chainOf } from './link.js';
import { controlOf, fenceOf, liveOf } from './live-car.js';
import { LogSync } from './log-sync.js';
import { PageWatch } from './page-watch.js';
import { DRAW_EVERY_MS, Painter } from './painter.js';
import { readMessage } from './protocol.js';
import { Requests } from './requests.js';
import { ScanFeed } from './scan-feed.js';
import { PageSocket } from './socket.js';

/**
 * @typedef {import('./protocol.js').State} State
 * @typedef {import('./protocol.js').AlarmEvent} AlarmEvent
 * @typedef {import('./event-log.js').Gap} Gap
 * @typedef {'move' | 'draw' | 'drawn' | 'scan' | 'beat' | 'tick' | 'log' | 'gap' | 'open' | 'replay' | 'refused'} Topic
 *   move: a fresh frame is to be drawn · draw: five times a second, seen or not by a frame · drawn: all of it was, and nothing failed · scan: a new scan ·
 *   beat: a fresh frame came (also while the page is hidden) · tick: time passed (seldom while it is hidden) · log: new events · gap: a blind time is over · open: connected · refused: an order was, with its answer · replay: its time line, or its end
 * @typedef {import('./requests.js').Answer} Answer
 */

export class Store {
  /** @type {State | null} */
  frame = null;
  /** Wall clock of the last fresh frame. @type {number | null} */
  heard_ms = null;
  /** Frames and scans that could not be read. */
  unreadable = 0;
  log = new EventLog();
  /** The build of the page that the server has now; '' where it cannot say. */
  build = '';
  /** The page shows a recording: frames of the live car are none of it, nor the other way round. */
  replaying = false;
  deadMan = new DeadMan();
  #clock = new ServerClock();
  /** How long the newest frame was under way [ms]. */
  #delay_ms = 0;
  #started_ms = 0;
  /** What an answer said of this page's lease, until the frames have it. @type {number | null} */
  #granted = null;
  /** Who this page is to the server. @type {import('./protocol.js').Hello['who'] | null} */
  who = null;
  /** @type {Emitter<Topic>} */
  #emitter = new Emitter((error) => this.painter.failed(error));
  painter = new Painter(this.#emitter);
  #send = (/** @type {object} */ message) => this.socket.send(message);
  #requests = new Requests(this.#send, (answer) => this.#emitter.emit('refused', answer));
  scans = new ScanFeed(this.#send);
  sync = new LogSync(this.log, this.#send, this.#emitter);
  #watch = new PageWatch({
    look: () => this.#emitter.guard(() => this.#look()),
    slept: (isBack, isRestored) => this.#emitter.guard(() => this.#slept(isBack, isRestored)),
    online: () => this.socket.hurry(),
  });

  #nameOf;
  #pageOf;

  /**
   * @param {() => import('./socket.js').Socket} dial
   * @param {() => string} [name] what this phone is called in the log
   * @param {() => string} [page] by which the server knows this page
   */
  constructor(dial, name = () => '', page = () => '') {
    this.#nameOf = name;
    this.#pageOf = page;
    this.socket = new PageSocket(
      {
        opened: () => this.#emitter.guard(() => {
          this.#granted = null;
          this.#clock.reset();
          this.scans.opened();
        }),
        text: (text, at_ms) => this.#emitter.guard(() => this.#heard(text, at_ms)),
        bytes: (bytes) => this.#emitter.guard(() => this.#heardScan(bytes)),
        closed: () => this.#emitter.guard(() => {
          this.sync.closed();
          this.#requests.broke();
        }),
      },
      dial,
    );
  }

  /** What this phone is called in the log. */
  get name() {
    return this.#nameOf();
  }

  /** By which the server knows this page; '' where it does not. */
  get page() {
    return this.#pageOf();
  }

  /** Begin to dial and to draw. */
  start() {
    this.#started_ms = this.now();
    this.#watch.start(DRAW_EVERY_MS);
    this.socket.look(this.now());
  }

  stop() {
    this.#watch.stop();
    this.#emitter.clear(); // a picture may be under way
    this.socket.stop();
  }

  /** Monotonic time [ms]. */
  now() {
    return performance.now();
  }

  /**
   * Listen; the result stops listening.
   * @param {Topic} topic
   * @param {(detail?: any) => void} listener
   */
  on(topic, listener) {
    return this.#emitter.on(topic, listener);
  }

  /** Nothing fresh has come for so long that the values are covered, or nothing ever came. */
  get isSilent() {
    return this.deadMan.covered || (this.frame === null && this.silence_s > 2);
  }

  /** Seconds without a fresh frame; before the first, since the page began. */
  get silence_s() {
    return (this.now() - Math.max(this.deadMan.heard_ms, this.#started_ms)) / 1000;
  }

  /** Age of the newest frame at the glass [s]: its way here and the silence since. */
  get lag_s() {
    return Math.max(0, this.silence_s) + this.#delay_ms / 1000;
  }

  /** The chain as it stands now. */
  get chain() {
    return chainOf({ frame: this.frame, isSilent: this.isSilent, silence_s: this.silence_s, lag_s: this.lag_s, heard_ms: this.heard_ms });
  }

  /** Is the vehicle being monitored, as far as the page knows? */
  get isMonitoring() {
    return this.frame?.session.phase === 'monitoring' || this.frame?.session.phase === 'lost';
  }

  /** This device was let in to look, and no more. */
  get isViewer() {
    return this.who?.role === 'viewer';
  }

  /** What must be heard of: the live car, also while a recording is shown. @returns {State | null} */
  get heeded() {
    return liveOf(this.frame);
  }

  /** Who is in control of the live car, also while a recording is shown. */
  get control() {
    return controlOf(this.frame);
  }

  /** The number of the lease by which this page is in control; null: it is not. */
  get fence() {
    return fenceOf(this.control, this.page, this.#granted);
  }

  /** A signal of the newest frame. @param {string} name */
  signal(name) {
    return this.frame?.signals[name];
  }

  /** How much ink a signal deserves now. @param {string} name */
  ink(name) {
    return freshnessStyle(this.signal(name), this.lag_s);
  }

  /** A limit of the newest frame, or null. @param {string} name */
  limit(name) {
    const value = this.frame?.limits[name];
    return typeof value === 'number' ? value : null;
  }

  /**
   * Ask the server for something, under the lease that this page has.
   * @param {string} kind
   * @param {object} [fields]
   * @param {number} [within_ms]
   */
  ask(kind, fields = {}, within_ms) {
    const { fence } = this;
    return this.#requests.ask(kind, { ...fields, ...(fence === null ? {} : { fence }) }, within_ms);
  }

  /** @param {string} text @param {number} [at_ms] when it came */
  #heard(text, at_ms = this.now()) {
    const message = readMessage(text);
    if (!message) {
      this.unreadable += 1;
      return;
    }
    switch (message.kind) {
      case 'hello':
        return this.#greeted(message, at_ms);
      case 'offer':
        return this.scans.offered(message.seq, this.now());
      case 'state':
        return this.#state(message, at_ms);
      case 'events':
        return this.sync.take(message.events);
      case 'replay':
        this.replaying = false; // it ended: what comes now is live
        return this.#emitter.emit('replay', message);
      case 'timeline':
        return this.#emitter.emit('replay', message);
      case 'reply':
        this.#granted = message.fence ?? null;
        return this.#requests.answered(message);
      case 'problem':
        return console.warn('The server did not understand:', message.reason);
    }
  }

  /** @param {import('./protocol.js').Hello} hello @param {number} at_ms when it came */
  #greeted(hello, at_ms) {
    this.#clock.note(hello.time_ms, at_ms);
    this.build = hello.build ?? '';
    this.who = hello.who ?? null;
    this.sync.greeted(hello, { name: this.name, ...(this.page ? { page: this.page } : {}) }, this.heard_ms === null ? 0 : this.silence_s);
  }

  /** @param {State} frame @param {number} now_ms when it came */
  #state(frame, now_ms) {
    if ((frame.replay !== undefined) !== this.replaying) {
      this.socket.proof(now_ms);
      return; // under way while the page turned, or while a recording is opened again
    }
    const delay_ms = this.#clock.note(frame.server.time_ms, now_ms);
    if (!this.deadMan.frame(now_ms, delay_ms)) return; // a memory, not service
    const isFirst = this.frame === null;
    this.frame = frame;
    this.#delay_ms = delay_ms;
    this.heard_ms = Date.now() - (this.now() - now_ms);
    this.socket.proof(now_ms);
    this.#emitter.emit('beat');
    this.painter.frame(frame, now_ms, isFirst);
  }

  /** @param {ArrayBuffer} bytes */
  #heardScan(bytes) {
    if (this.scans.take(bytes)) this.#emitter.emit('scan');
    else this.unreadable += 1;
  }

  #look() {
    this.painter.look(!document.hidden);
    const now_ms = this.now();
    if (this.#watch.slept_ms(now_ms) > 2000 && this.frame) this.deadMan.cover();
    this.deadMan.look(now_ms);
    this.socket.look(now_ms);
    if (!document.hidden) this.painter.keepUp(now_ms, this.deadMan.heard_ms);
    this.#emitter.emit('tick');
  }

  /** Hidden, frozen or back: the veil comes first, whatever the clocks say. @param {boolean} isBack @param {boolean} isRestored */
  #slept(isBack, isRestored) {
    if (this.frame && (!isRestored || this.silence_s > 1)) this.deadMan.cover();
    if (isBack) this.socket.hurry();
    if (this.frame) this.painter.draw(); // before, there is nothing to cover
  }
}
