// What the page knows: the newest frame, how old it is, the log of events; and the way to ask the server for something.

import { ServerClock } from './clock.js';
import { DeadMan } from './dead-man.js';
import { Drawing } from './drawing.js';
import { EventLog } from './events.js';
import { inkOf } from './freshness.js';
import { chainOf } from './link.js';
import { readMessage } from './protocol.js';
import { readScan } from './scan-frame.js';
import { Wire } from './wire.js';

/** Digits change at most five times a second. */
const DRAW_EVERY_MS = 200;
/** What moves, moves for so long from one frame to the next (instruments.css): a new aim sooner would only cost [ms]. */
const MOVE_EVERY_MS = 95;
/** While frames come so close after each other they set the pace of drawing, after that a timer does [ms]. */
const FED_MS = 300;
/** A command is for now: without an answer by then it counts as refused [ms]. */
const REPLY_MS = 4000;

/**
 * @typedef {import('./protocol.js').State} State
 * @typedef {import('./protocol.js').AlarmEvent} AlarmEvent
 * @typedef {import('./events.js').Gap} Gap
 * @typedef {'move' | 'draw' | 'drawn' | 'scan' | 'beat' | 'tick' | 'log' | 'gap' | 'open' | 'replay' | 'refused'} Topic
 *   move: a fresh frame is to be drawn · draw: five times a second, seen or not by a frame · drawn: all of it was, and nothing failed · scan: a new scan ·
 *   beat: a fresh frame came (also while the page is hidden) · tick: time passed (seldom while it is hidden) · log: new events · gap: a blind time is over · open: connected · refused: an order was, with its answer · replay: its time line, or its end
 * @typedef {{ok: boolean, reason?: string, suggestion?: string, version?: number, isConflict?: boolean, heldBy?: string}} Answer suggestion: an address
 *   that would do; version: of the settings, once changed; isConflict: somebody else changed them in between; heldBy: who is in control instead
 */

export class Store {
  /** @type {State | null} */
  frame = null;
  /** @type {import('./scan-frame.js').Scan | null} */
  scan = null;
  /** When the newest scan was asked for [ms, monotonic]: it cannot be older than its own age and that. */
  scanAt_ms = -Infinity;
  #took_ms = -Infinity;
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
  drawing = new Drawing();
  /** What tells the operator that this page does not draw. @type {{show(): void, hide(): void} | null} */
  undrawn = null;
  /** Something failed since the last drawing. */
  #hasFailed = false;
  #complained = '';
  /** @type {Set<string>} names of what wants the scan */
  #watchers = new Set();
  #clock = new ServerClock();
  /** How long the newest frame was under way [ms]. */
  #delay_ms = 0;
  #started_ms = 0;
  #drew_ms = -Infinity;
  #moved_ms = -Infinity;
  /** Nothing is drawn any more, and nothing is answered. */
  isStopped = false;
  #isMoved = false;
  #urgent = '';
  #isUrgent = false;
  #asked = 0;
  /** What an answer said of this page's lease, until the frames have it. @type {number | null} */
  #granted = null;
  /** Who this page is to the server. @type {import('./protocol.js').Hello['who'] | null} */
  who = null;
  /** @type {Map<string, (answer: Answer) => void>} */
  #waiting = new Map();
  /** @type {Map<Topic, Set<(detail?: any) => void>>} */
  #listeners = new Map();
  /** @type {(() => void)[]} */
  #stops = [];
  #looked_ms = 0;
  #lookedWall_ms = 0;

  #nameOf;
  #pageOf;
  /** The answer to the server's greeting, while it is owed. @type {(() => void) | null} */
  #owed = null;
  #mayGreet = false;

  /**
   * @param {() => import('./wire.js').Socket} dial
   * @param {() => string} [name] what this phone is called in the log
   * @param {() => string} [page] by which the server knows this page
   */
  constructor(dial, name = () => '', page = () => '') {
    this.#nameOf = name;
    this.#pageOf = page;
    this.wire = new Wire(
      {
        opened: () => this.#guard(() => this.#opened()),
        text: (text, at_ms) => this.#guard(() => this.#heard(text, at_ms)),
        bytes: (bytes) => this.#guard(() => this.#heardScan(bytes)),
        closed: () => this.#guard(() => this.#closed()),
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
    this.#started_ms = this.#looked_ms = this.now();
    this.#lookedWall_ms = Date.now();
    const timer = setInterval(() => this.#guard(() => this.#look()), DRAW_EVERY_MS);
    this.#stops.push(() => clearInterval(timer));
    for (const [target, type] of /** @type {[EventTarget, string][]} */ ([[document, 'visibilitychange'], [document, 'freeze'], [document, 'resume'], [window, 'pageshow']])) {
      const listener = (/** @type {Event} */ event) => {
        if (type !== 'pageshow' || /** @type {PageTransitionEvent} */ (event).persisted) this.#guard(() => this.#slept(type)); // a page that begins is “shown” too
      };
      target.addEventListener(type, listener);
      this.#stops.push(() => target.removeEventListener(type, listener));
    }
    const online = () => this.wire.hurry();
    window.addEventListener('online', online);
    this.#stops.push(() => window.removeEventListener('online', online));
    this.wire.look(this.now());
  }

  stop() {
    for (const stop of this.#stops.splice(0)) stop();
    this.#listeners.clear(); // a picture may be under way
    this.isStopped = true;
    this.wire.stop();
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
    const all = this.#listeners.get(topic) ?? new Set();
    this.#listeners.set(topic, all);
    all.add(listener);
    return () => void all.delete(listener);
  }

  /** From now on the server's greeting is answered: who a page is that just begins can wait until it shows the car. */
  greet() {
    this.#mayGreet = true;
    this.#owed?.();
  }

  /** Whenever the server greets this page, and at once where it has. @param {() => void} listener */
  whenOpen(listener) {
    if (this.log.boot !== null) listener();
    return this.on('open', listener);
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
    const { frame } = this;
    if (!frame?.replay) return frame;
    const { live } = frame;
    const decelerate = live?.decelerate ?? { state: 'not_available', why: null };
    return live ? { ...frame, alarms: live.alarms, recording: live.recording, decelerate, session: { ...frame.session, phase: live.phase, paused: live.paused } } : null;
  }

  /** Who is in control of the live car, also while a recording is shown. */
  get control() {
    const { frame } = this;
    return (frame?.replay ? frame.live?.control : frame?.control) ?? null;
  }

  /** The number of the lease by which this page is in control; null: it is not. */
  get fence() {
    const { control } = this;
    const known = control?.page === this.page && this.page ? (control.fence ?? null) : null;
    return this.#granted !== null && (control?.fence ?? 0) < this.#granted ? this.#granted : known;
  }

  /** From now on a recording, or live again. @param {boolean} isReplay */
  turn(isReplay) {
    this.replaying = isReplay;
  }

  /** A signal of the newest frame. @param {string} name */
  signal(name) {
    return this.frame?.signals[name];
  }

  /** How much ink a signal deserves now. @param {string} name */
  ink(name) {
    return inkOf(this.signal(name), this.lag_s);
  }

  /**
   * A limit of the newest frame, or null.
   * @param {string} name
   */
  limit(name) {
    const value = this.frame?.limits[name];
    return typeof value === 'number' ? value : null;
  }

  /**
   * Ask the server for something. It is refused at once where the server is not there: a command is never kept for later.
   * @param {string} kind
   * @param {object} [fields]
   * @param {number} [within_ms]
   * @returns {Promise<Answer>}
   */
  ask(kind, fields = {}, within_ms = REPLY_MS) {
    this.#asked += 1;
    const id = `p${this.#asked}`;
    const { fence } = this;
    if (!this.wire.send({ kind, id, ...fields, ...(fence === null ? {} : { fence }) })) {
      return Promise.resolve({ ok: false, reason: 'Not sent: the server does not answer.' });
    }
    return new Promise((resolve) => {
      this.#waiting.set(id, resolve);
      setTimeout(() => this.#answer(id, { ok: false, reason: 'The server gave no answer in time.' }), within_ms);
    });
  }

  /**
   * Have scans sent while anyone wants them.
   * @param {string} who
   * @param {boolean} isWanted
   */
  watchScan(who, isWanted) {
    const was = this.#watchers.size > 0;
    if (isWanted) this.#watchers.add(who);
    else this.#watchers.delete(who);
    if (was !== this.#watchers.size > 0) this.wire.send({ kind: 'watch', scan: !was });
  }

  #opened() {
    this.#granted = null;
    this.#clock.reset();
    if (this.#watchers.size) this.wire.send({ kind: 'watch', scan: true });
  }

  #closed() {
    this.#owed = null;
    for (const id of [...this.#waiting.keys()]) this.#answer(id, { ok: false, reason: 'The connection to the server broke.' });
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
        this.#clock.note(message.time_ms, at_ms);
        this.#greeted(message);
        break;
      case 'offer':
        this.#took_ms = this.now();
        this.wire.send({ kind: 'take', seq: message.seq });
        break;
      case 'state':
        this.#state(message, at_ms);
        break;
      case 'events': {
        if (this.#owed) { // they came before this page told what it has: from there they are sent again, and in order
          this.#owed();
          this.wire.send({ kind: 'have', event: this.log.last ?? 0 });
          break;
        }
        const fresh = this.log.take(message.events);
        this.wire.send({ kind: 'have', event: this.log.last ?? 0 });
        if (fresh.length) this.#emit('log', fresh);
        this.#caughtUp();
        break;
      }
      case 'replay':
        this.turn(false); // it ended: what comes now is live
        this.#emit('replay', message);
        break;
      case 'timeline':
        this.#emit('replay', message);
        break;
      case 'reply':
        this.#granted = message.fence ?? null;
        this.#answer(message.id, answerOf(message));
        break;
      case 'problem':
        console.warn('The server did not understand:', message.reason);
        break;
    }
  }

  /** @param {import('./protocol.js').Hello} hello */
  #greeted(hello) {
    this.build = hello.build ?? '';
    this.who = hello.who ?? null;
    const blind_s = this.heard_ms === null ? 0 : this.silence_s;
    const have_event = this.log.greet(hello.boot, hello.last_event, blind_s, Date.now());
    this.#owed = () => {
      this.#owed = null;
      this.wire.send({ kind: 'hello', have_event, boot: hello.boot, name: this.name, ...(this.page ? { page: this.page } : {}) });
    };
    if (this.#mayGreet) this.#owed();
    this.#caughtUp();
    this.#emit('open', hello);
  }

  /** @param {State} frame @param {number} now_ms when it came */
  #state(frame, now_ms) {
    if ((frame.replay !== undefined) !== this.replaying) {
      this.wire.proof(now_ms);
      return; // under way while the page turned, or while a recording is opened again
    }
    const delay_ms = this.#clock.note(frame.server.time_ms, now_ms);
    if (!this.deadMan.frame(now_ms, delay_ms)) return; // a memory, not service
    const isFirst = this.frame === null;
    this.frame = frame;
    this.#delay_ms = delay_ms;
    this.heard_ms = Date.now() - (this.now() - now_ms);
    this.wire.proof(now_ms);
    this.#emit('beat');
    // What asks for the operator is drawn at once; pointers ten times a second, the rest five times and with them.
    const urgent = urgentOf(frame);
    const isUrgent = urgent !== this.#urgent;
    this.#urgent = urgent;
    if (isUrgent) this.#isUrgent = true;
    if (this.#isMoved || (!isUrgent && now_ms - this.#moved_ms < MOVE_EVERY_MS)) return;
    this.#isMoved = true;
    this.#moved_ms = now_ms;
    const show = () => {
      this.#isMoved = false;
      this.#emit('move');
      if (this.#isUrgent || now_ms - this.#drew_ms >= 2 * MOVE_EVERY_MS) this.#draw();
      this.#isUrgent = false;
    };
    if (isFirst) show(); // nothing moves yet that a picture could fall between
    else this.picture(show);
  }

  /** Draw with the next picture; what it throws is a failure of drawing. @param {() => void} draw */
  picture(draw) {
    requestAnimationFrame(() => this.#guard(draw));
  }

  /** @param {ArrayBuffer} bytes */
  #heardScan(bytes) {
    const scan = readScan(bytes);
    if (!scan) {
      this.unreadable += 1;
      return;
    }
    this.scan = scan;
    this.scanAt_ms = this.#took_ms;
    this.#emit('scan');
  }

  #look() {
    const wasFailed = this.drawing.isFailed;
    this.drawing.look(!document.hidden);
    if (this.drawing.isFailed) {
      if (!wasFailed) console.error('Nothing was drawn for 1 s');
      this.undrawn?.show();
      this.#isMoved = false; // a picture that was asked for may never come
    }
    const now_ms = this.now();
    // The monotonic clock of a phone stands still while the phone sleeps, its wall clock does not.
    const slept_ms = Date.now() - this.#lookedWall_ms - (now_ms - this.#looked_ms);
    this.#looked_ms = now_ms;
    this.#lookedWall_ms = Date.now();
    if (slept_ms > 2000 && this.frame) this.deadMan.cover();
    this.deadMan.look(now_ms);
    this.wire.look(now_ms);
    if (!document.hidden && now_ms - this.deadMan.heard_ms > FED_MS && now_ms - this.#drew_ms >= DRAW_EVERY_MS - 20) this.picture(() => this.#draw());
    this.#emit('tick');
  }

  #draw() {
    this.#drew_ms = this.now();
    this.#emit('draw');
    if (!this.#hasFailed) this.#emit('drawn');
    const isComplete = !this.#hasFailed;
    this.#hasFailed = false;
    if (!isComplete) return;
    this.drawing.completed();
    if (!this.drawing.isFailed) this.undrawn?.hide();
  }

  /**
   * Hidden, frozen or back: the veil comes first, whatever the clocks say.
   * @param {string} type
   */
  #slept(type) {
    const isBack = type === 'resume' || type === 'pageshow' || !document.hidden;
    if (this.frame && (type !== 'pageshow' || this.silence_s > 1)) this.deadMan.cover();
    if (isBack) this.wire.hurry();
    if (this.frame) this.#draw(); // before, there is nothing to cover
  }

  #caughtUp() {
    const gap = this.log.caughtUp();
    if (gap) this.#emit('gap', gap);
  }

  /**
   * @param {string} id
   * @param {Answer} answer
   */
  #answer(id, answer) {
    if (!answer.ok && this.#waiting.has(id)) this.#emit('refused', answer);
    this.#waiting.get(id)?.(answer);
    this.#waiting.delete(id);
  }

  /**
   * @param {Topic} topic
   * @param {any} [detail]
   */
  #emit(topic, detail) {
    for (const listener of this.#listeners.get(topic) ?? []) {
      try {
        listener(detail);
      } catch (error) {
        this.#failed(error); // one broken panel must not stop the veil, the sound or the other panels
      }
    }
  }

  /** @param {() => void} act */
  #guard(act) {
    try {
      act();
    } catch (error) {
      this.#failed(error);
    }
  }

  /** The page covers itself: what was to be drawn, heard or sounded was not. @param {unknown} error */
  #failed(error) {
    this.#hasFailed = true;
    this.drawing.failed();
    this.undrawn?.show();
    const complaint = `${error}`;
    if (complaint === this.#complained) return; // the same ten times a second
    this.#complained = complaint;
    try {
      console.error(error);
    } catch {
      // even that may be what is broken
    }
  }
}

/**
 * @param {import('./protocol.js').Reply} reply
 * @returns {Answer}
 */
function answerOf({ ok, reason, problem, version, conflict, held_by }) {
  return {
    ok, ...(reason ? { reason } : {}), ...(problem?.suggestion ? { suggestion: problem.suggestion } : {}),
    ...(version === undefined ? {} : { version }), ...(conflict ? { isConflict: true } : {}), ...(held_by ? { heldBy: held_by } : {}),
  };
}

/**
 * What must not wait for the next drawing: alarms, the link, a pause.
 * @param {State | null} frame
 */
function urgentOf(frame) {
  if (!frame) return '';
  const { session, link, alarms, decelerate } = frame;
  const { order } = decelerate;
  const slow = [decelerate.state, order?.number, order?.sending, order?.confirmed, order?.stands, (frame.live?.decelerate ?? decelerate).countdown?.trigger].join(' ');
  return [session.phase, session.paused, link.cut, slow, ...alarms.map((alarm) => `${alarm.id} ${alarm.occurrence} ${alarm.state}`)].join('|');
}
