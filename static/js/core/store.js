// What the page knows: the newest frame, how old it is, the log of events; and the way to ask the server for something.

import { ServerClock } from './clock.js';
import { DeadMan } from './dead-man.js';
import { Emitter } from './emitter.js';
import { EventLog } from './event-log.js';
import { freshnessStyle, withQuestion } from './freshness.js';
import { chainOf } from './link.js';
import { Known } from './known.js';
import { challengeOf, fenceOf } from './live-car.js';
import { LogSync } from './log-sync.js';
import { PageWatch } from './page-watch.js';
import { DRAW_EVERY_MS, Painter } from './painter.js';
import { readMessage } from './protocol.js';
import { Requests } from './requests.js';
import { ScanFeed } from './scan-feed.js';
import { Seal } from './signer.js';
import { PageSocket } from './socket.js';
import { unseenOf } from './unseen.js';

/**
 * @typedef {import('./protocol-types.js').State} State
 * @typedef {import('./protocol-types.js').Signals} Signals
 * @typedef {import('./protocol-types.js').LogEvent} AlarmEvent
 * @typedef {import('./event-log.js').Gap} Gap
 * @typedef {'move' | 'draw' | 'drawn' | 'scan' | 'beat' | 'tick' | 'log' | 'gap' | 'open' | 'replay' | 'refused' | 'switch' | 'leave' | 'cars' | 'became' | 'duty'} Topic
 *   switch: another car is shown from now on, and nothing is known of it yet · leave: the socket to the car before is about to be closed · cars: the list of cars came · duty: who is on duty changed ·
 *   became: what became of an order that was not answered · move: a fresh frame is to be drawn · draw: five times a second, seen or not by a frame · drawn: all of it was, and nothing failed · scan: a new scan ·
 *   beat: a fresh frame came (also while the page is hidden) · tick: time passed (seldom while it is hidden) · log: new events · gap: a blind time is over · open: connected · refused: an order was, with its answer · replay: its time line, the recording beside it, or an end
 * @typedef {import('./requests.js').Answer} Answer
 */

export class Store extends Known {
  unreadable = 0; // frames and scans that could not be read
  log = new EventLog();
  #cars_ms = -Infinity;
  deadMan = new DeadMan();
  #clock = new ServerClock();
  #delay_ms = 0; // how long the newest frame was under way
  #started_ms = 0;
  /** This page's lease as an answer stated, until the frames have it. @type {number | null} */
  #granted = null;
  /** @type {Emitter<Topic>} */
  #emitter = new Emitter((error) => this.painter.failed(error));
  painter = new Painter(this.#emitter);
  #send = (/** @type {object} */ message) => this.socket.send(message);
  seal = new Seal(() => this);
  #requests = new Requests((message) => this.sync.hasGreeted && this.#send(message), (answer) => this.#emitter.emit('refused', answer), (message) => this.seal.sealed(message, this.vehicle, challengeOf(this.frame)), (found) => this.#emitter.emit('became', found));
  scans = new ScanFeed(this.#send);
  sync = new LogSync(this.log, this.#send, this.#emitter);
  #watch = new PageWatch({
    look: () => this.#emitter.guard(() => this.#look()),
    slept: (isBack, isRestored) => this.#emitter.guard(() => this.#slept(isBack, isRestored)),
    online: () => this.socket.hurry(),
  });

  #self;

  /**
   * @param {() => import('./socket.js').Socket} dial
   * @param {() => string} [name] what this phone is called in the log
   * @param {() => string} [page] by which the server knows this page
   */
  constructor(dial, name = () => '', page = () => '') {
    super();
    this.#self = { name, page };
    this.socket = new PageSocket(
      {
        opened: () => this.#emitter.guard(() => {
          [this.#granted, this.unserved] = [null, ''];
          this.sync.closed();
          this.scans.opened();
        }),
        text: (text, at_ms) => this.#emitter.guard(() => this.#received(text, at_ms)),
        bytes: (bytes) => this.#emitter.guard(() => this.#receivedScan(bytes)),
        closed: () => this.#emitter.guard(() => this.#broke()),
      },
      dial,
    );
  }

  /** What this phone is called in the log. */
  get name() {
    return this.#self.name();
  }

  /** By which the server knows this page; '' where it does not. */
  get page() {
    return this.#self.page();
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

  /**
   * Show another car: all that is known of the one before is dropped before the other is dialled.
   * @param {string} vehicle
   */
  show(vehicle) {
    if (vehicle === this.vehicle) return;
    this.#emitter.emit('leave');
    this.socket.hangUp();
    this.#broke();
    this.#requests.forget();
    this.turnTo(vehicle);
    this.#forget();
    this.#emitter.emit('switch');
    this.painter.draw();
    this.socket.look(this.now());
  }

  #broke() {
    this.sync.closed();
    this.#requests.broke();
  }

  #forget() {
    this.#granted = null;
    this.deadMan = new DeadMan();
    this.#delay_ms = 0;
    this.#started_ms = this.now();
    this.log.clear();
    this.scans.forget();
  }

  /** Monotonic time [ms]. */
  now = () => performance.now();

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
    return chainOf({ frame: this.frame, isSilent: this.isSilent, silence_s: this.silence_s, lag_s: this.lag_s, heard_ms: this.heard_ms, trip: this.socket.trip, unserved: this.socket.isOpen ? this.unserved : '' });
  }

  /** Age of the list of cars at the glass [s]. */
  get carsLag_s() {
    return (this.now() - this.#cars_ms) / 1000;
  }

  /** The number of the lease by which this page is in control; null: it is not. */
  get fence() {
    return fenceOf(this.control, this.page, this.#granted);
  }

  /** How much ink a signal deserves now. @param {string} name */
  ink(name) {
    return withQuestion(freshnessStyle(this.signal(name), this.lag_s), name, this.frame?.questions);
  }

  /**
   * Ask the server for something, under the lease that this page has.
   * @template {import('./protocol-types.js').PageMessage['kind']} Kind
   * @param {Kind} kind
   * @param {import('./requests.js').FieldsOf<Kind>} [fields]
   * @param {number} [within_ms]
   */
  ask(kind, fields, within_ms) {
    return this.#requests.ask(kind, /** @type {any} */ ({ ...momentOf(kind, this), ...fields, ...(this.fence === null ? {} : { fence: this.fence }) }), within_ms);
  }

  /** @param {string} text @param {number} [at_ms] when it came */
  #received(text, at_ms = this.now()) {
    this.#woke(); // a phone that wakes may read what came before the page looks at the time
    const message = readMessage(text);
    if (!message) return void [this.unreadable += 1, this.socket.unread(text)];
    if (message.kind === 'state' || message.kind === 'cars') this.socket.answered(at_ms, message.kind);
    switch (message.kind) {
      case 'hello': return this.#greeted(message, at_ms);
      case 'offer':
        this.#clock.note(message.took_ms, at_ms, this.socket.offered(message, at_ms));
        return void (message.of.length && this.socket.takeInTurn(() => this.scans.offered(message.seq, this.now()))); // of nothing: it only answers a take
      case 'state': return this.#state(message, at_ms);
      case 'cars':
        this.list(message);
        this.#cars_ms = at_ms - this.#clock.note(message.time_ms, at_ms);
        return this.#emitter.emit('cars');
      case 'duty':
        this.duty = message;
        return this.#emitter.emit('duty');
      case 'events': return this.sync.take(message.events, message.resumed);
      case 'timeline': case 'beside': case 'beside_ended': case 'replay':
        if (message.kind === 'replay') this.replaying = false; // it ended: what comes now is live
        return this.#emitter.emit('replay', message);
      case 'reply':
        this.#granted = message.fence ?? null;
        return this.#requests.answered(message);
      case 'unserved':
        this.unserved = message.why;
        return this.socket.proof(at_ms);
      case 'problem':
        return console.warn('The server did not understand:', message.reason);
    }
  }

  /** @param {import('./protocol-types.js').Hello} hello @param {number} at_ms when it came */
  #greeted(hello, at_ms) {
    if (!this.greet(hello)) return;
    this.seal.greeted(hello);
    this.#clock.greeted(hello, at_ms, this.socket.dialled_ms);
    this.sync.greeted(hello, { name: this.name, build: ownBuild(), ...(this.page ? { page: this.page } : {}) }, this.heard_ms === null ? 0 : this.silence_s);
  }

  /** @param {State} frame @param {number} now_ms when it came */
  #state(frame, now_ms) {
    if ((frame.replay !== undefined) !== this.replaying) {
      this.socket.proof(now_ms);
      return; // under way while the page turned, or while a recording is opened again
    }
    if (!frame.replay && this.vehicle && frame.vehicle !== this.vehicle) return;
    // What a part keeps, it keeps for one run of the server and one car.
    frame.server.boot = `${frame.server.boot} ${this.vehicle}`;
    const delay_ms = this.#clock.note(frame.server.time_ms, now_ms);
    const unseen_m = this.log.open && unseenOf(this);
    if (!this.socket.isTrusted || !this.deadMan.frame(now_ms, delay_ms)) return; // a memory, not service
    this.log.seen(unseen_m);
    const isFirst = this.take(frame, Date.now() - (this.now() - now_ms));
    this.#delay_ms = delay_ms;
    this.socket.proof(now_ms);
    this.#emitter.emit('beat');
    this.painter.frame(frame, now_ms, isFirst);
  }

  /** @param {ArrayBuffer} bytes */
  #receivedScan(bytes) {
    if (this.scans.take(bytes)) this.#emitter.emit('scan');
    else this.unreadable += 1;
  }

  #look() {
    this.painter.look(!document.hidden);
    const now_ms = this.now();
    this.#woke();
    this.deadMan.look(now_ms);
    this.socket.look(now_ms);
    if (this.socket.isOpen) this.#requests.look(now_ms);
    if (!document.hidden) this.painter.keepUp(now_ms, this.deadMan.heard_ms);
    this.#emitter.emit('tick');
  }

  #woke = () => void (this.#watch.slept_ms(this.now()) > 2000 && this.#cover());
  #cover = () => void [this.frame && this.deadMan.cover(), this.socket.slept()]; // before the first frame there is nothing to cover

  /** Hidden, frozen or back: the veil comes first, whatever the clocks say. @param {boolean} isBack @param {boolean} isRestored */
  #slept(isBack, isRestored) {
    if (this.frame && (!isRestored || this.silence_s > 1)) this.#cover();
    if (isBack) this.socket.hurry();
    if (this.frame) this.painter.draw(); // before, there is nothing to cover
  }
}

/** Which build this page is of; '' for single modules: the server then uses the present names. */
function ownBuild() {
  return globalThis.document?.documentElement.dataset['build'] ?? '';
}

/** By which the server sees how long an order was on its way: when the newest state was likely made, and how old it was. @param {string} kind @param {Store} store */
function momentOf(kind, { frame, lag_s }) {
  if (kind === 'replay' || !frame || frame.replay) return {};
  const later_s = Math.min(lag_s, Math.max(0, (frame.server.excess_ms ?? 0) / 1000)); // than `time_ms` it was likely made
  return { heard_ms: frame.server.time_ms + 1000 * later_s, held_s: lag_s - later_s };
}
