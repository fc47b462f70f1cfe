// What the page of all cars knows: the newest list, how old it is, what each car stated last, and the way to ask the server.

import { ServerClock } from '../core/clock.js';
import { DeadMan } from '../core/dead-man.js';
import { Emitter } from '../core/emitter.js';
import { PageWatch } from '../core/page-watch.js';
import { DRAW_EVERY_MS, Painter } from '../core/painter.js';
import { readMessage } from '../core/protocol.js';
import { Requests } from '../core/requests.js';
import { Seal } from '../core/signer.js';
import { PageSocket } from '../core/socket.js';
import { timerLength, withEvent } from './fleet-layout.js';

/**
 * @typedef {import('../core/protocol-types.js').Cars} Cars
 * @typedef {import('../core/protocol-types.js').CarSummary} CarSummary
 * @typedef {import('../core/store.js').Topic} Topic
 * @typedef {import('./fleet-layout.js').FleetEvent} FleetEvent
 * @typedef {{summary: CarSummary, at_ms: number, timer_s: number}} Kept what a car stated last, when [ms, monotonic], and how long its timer is
 */

export class FleetStore {
  /** @type {Cars | null} */
  cars = null;
  /** What each car stated last, for when it is silent. @type {Map<string, Kept>} */
  kept = new Map();
  /** Who took and handed over what, newest first. @type {FleetEvent[]} */
  events = [];
  /** @type {import('../core/protocol-types.js').Hello['who'] | null} */
  who = null;
  /** Who is on duty at this device; null: not received yet. @type {import('../core/protocol-types.js').Duty | null} */
  duty = null;
  /** Wall clock of the newest list. @type {number | null} */
  heard_ms = null;
  /** The server greeted this page after the newest list came: it answers, and has no list. */
  isAnswering = false;
  /** Why the server has nothing of the cars, in its own text. */
  unserved = '';
  deadMan = new DeadMan();
  #cars_ms = -Infinity;
  #started_ms = 0;
  #hasGreeted = false;
  #clock = new ServerClock();
  /** @type {Emitter<Topic>} */
  #emitter = new Emitter((error) => this.painter.failed(error));
  painter = new Painter(this.#emitter);
  seal = new Seal(() => ({ who: this.who, duty: this.duty, ...this.self }));
  #requests = new Requests(
    (message) => this.sync.hasGreeted && this.socket.send(message), (answer) => this.#emitter.emit('refused', answer), (message) => this.#sealed(message),
    (found) => this.#emitter.emit('became', found),
  );
  #watch = new PageWatch({
    look: () => this.#emitter.guard(() => this.#look()),
    slept: (isBack, isRestored) => this.#emitter.guard(() => this.#slept(isBack, isRestored)),
    online: () => this.socket.hurry(),
  });
  /** As the ordinary page's store has it. */
  sync = {
    /** The server knows who this page is, on this connection: before, it files a command under nobody. */
    hasGreeted: false,
    whenOpen: (/** @type {() => void} */ listener) => {
      if (this.#hasGreeted) listener();
      return this.on('open', listener);
    },
  };

  /**
   * @param {() => import('../core/socket.js').Socket} dial
   * @param {{name: string, page: string}} self what this device is called, and by which the server knows this page
   */
  constructor(dial, self) {
    this.self = self;
    this.socket = new PageSocket({
      opened: () => void (this.sync.hasGreeted = false),
      text: (text, at_ms) => this.#emitter.guard(() => this.#received(text, at_ms)),
      bytes: () => {},
      closed: () => this.#emitter.guard(() => this.#requests.broke()),
    }, dial);
  }

  /** What this device is called in the log. */
  get name() {
    return this.self.name;
  }

  get page() {
    return this.self.page;
  }

  get isViewer() {
    return this.who?.role === 'viewer';
  }

  start() {
    this.#started_ms = this.now();
    this.#watch.start(DRAW_EVERY_MS);
    this.socket.look(this.now());
  }

  stop() {
    this.#watch.stop();
    this.#emitter.clear();
    this.socket.stop();
  }

  /** Monotonic time [ms]. */
  now() {
    return performance.now();
  }

  /** @param {Topic} topic @param {(detail?: any) => void} listener */
  on(topic, listener) {
    return this.#emitter.on(topic, listener);
  }

  /** No fresh list came for so long that nothing is known of the cars, or none ever came. */
  get isSilent() {
    return this.deadMan.covered || (this.cars === null && this.silence_s > 2);
  }

  /** Seconds without a fresh list; before the first, since the page began. */
  get silence_s() {
    return (this.now() - Math.max(this.deadMan.heard_ms, this.#started_ms)) / 1000;
  }

  /** Age of the newest list at the glass [s]: its way here and the silence since. */
  get lag_s() {
    return this.cars ? Math.max(0, (this.now() - this.#cars_ms) / 1000) : Math.max(0, this.silence_s);
  }

  /** The server's wall clock now, as this page's monotonic clock has carried it on since the newest list [ms]. */
  get serverNow_ms() {
    return (this.cars?.time_ms ?? 0) + this.lag_s * 1000;
  }

  /**
   * @param {string} kind
   * @param {Record<string, unknown>} fields
   * @returns {Promise<import('../core/requests.js').Answer>}
   */
  ask(kind, fields) {
    return this.#requests.ask(/** @type {any} */ (kind), /** @type {any} */ (fields));
  }

  /** @param {{kind: string, id: string, vehicle?: string}} message */
  #sealed(message) {
    const { vehicle = '' } = message;
    const challenge = this.cars?.cars.find(({ name }) => name === vehicle)?.summary?.challenge;
    return this.seal.sealed(message, vehicle, challenge);
  }

  /** Dials again at once. */
  retry() {
    this.socket.hangUp();
    this.socket.look(this.now());
  }

  /** @param {string} text @param {number} [at_ms] when it came */
  #received(text, at_ms = this.now()) {
    this.#woke(); // a phone that wakes may read what came before the page looks at the time
    const message = readMessage(text);
    if (!message) return undefined;
    switch (message.kind) {
      case 'hello':
        return this.#greeted(message, at_ms);
      case 'offer':
        this.#clock.note(message.took_ms, at_ms, this.socket.offered(message, at_ms));
        return void this.socket.send({ kind: 'take', seq: message.seq });
      case 'cars':
        return this.#list(message, at_ms);
      case 'fleet_event':
        this.events = withEvent(this.events, message);
        return this.#emitter.emit('log');
      case 'duty':
        this.duty = message;
        this.#emitter.emit('duty');
        return this.painter.draw();
      case 'unserved':
        this.unserved = message.why;
        return this.socket.proof(at_ms);
      case 'reply':
        return this.#requests.answered(message);
      case 'problem':
        return console.warn('The server did not understand:', message.reason);
    }
    return undefined;
  }

  /** @param {import('../core/protocol-types.js').Hello} hello @param {number} at_ms */
  #greeted(hello, at_ms) {
    this.who = hello.who ?? null;
    this.seal.greeted(hello);
    this.isAnswering = true;
    this.unserved = '';
    this.#clock.greeted(hello, at_ms, this.socket.dialled_ms);
    this.sync.hasGreeted = this.socket.send({ kind: 'hello', boot: hello.boot, name: this.self.name, page: this.self.page });
    this.#hasGreeted = true;
    this.#emitter.emit('open', hello);
  }

  /** @param {Cars} cars @param {number} at_ms */
  #list(cars, at_ms) {
    this.socket.answered(at_ms, 'cars');
    const delay_ms = this.#clock.note(cars.time_ms, at_ms);
    if (!this.deadMan.frame(at_ms, delay_ms)) return; // of long ago
    this.cars = cars;
    this.#cars_ms = at_ms - delay_ms;
    this.heard_ms = Date.now() - (this.now() - this.#cars_ms);
    this.isAnswering = false;
    this.unserved = '';
    for (const { name, summary, age_s } of cars.cars) {
      if (summary) this.kept.set(name, { summary, at_ms: this.#cars_ms - (age_s ?? 0) * 1000, timer_s: timerLength(this.kept.get(name), summary, cars.time_ms) });
    }
    this.socket.proof(at_ms);
    this.#emitter.emit('beat');
    this.#emitter.emit('cars');
    this.painter.picture(() => this.painter.draw());
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

  #woke = () => void (this.#watch.slept_ms(this.now()) > 2000 && this.cars && this.deadMan.cover());

  /** Hidden, frozen or back. @param {boolean} isBack @param {boolean} isRestored */
  #slept(isBack, isRestored) {
    if (this.cars && (!isRestored || this.silence_s > 1)) this.deadMan.cover();
    if (isBack) this.socket.hurry();
    this.painter.draw();
  }
}
