// This phone's position: requested from the browser once the operator armed it, sent to the server while a car is monitored.

import { ownName } from '../control/own-name.js';
import { PositionReporter, whyOf } from './phone-fix.js';

/** @typedef {import('../boot/arming.js').Armed} Armed */

const ARMED = 'catgraph.armed';
const OPTIONS = { enableHighAccuracy: true, maximumAge: 0, timeout: 10000 };
/** A watch may report nothing while the phone does not move: it is started again then [ms]. */
const NUDGE_MS = 2500;
/** The tap comes before the car is dialled [ms]. */
const DIALLING_MS = 15000;
/** The server's time in a frame older than this tells little about the delay [ms]. */
const ECHO_MS = 2000;

/** Only then a position is wanted. */
const WATCHED = ['monitoring', 'lost'];

/** @param {string} name */
function kept(name) {
  try {
    return sessionStorage.getItem(name);
  } catch {
    return null; // storage may be forbidden
  }
}

/** @param {string} name @param {string} value */
function keep(name, value) {
  try {
    sessionStorage.setItem(name, value);
  } catch {
    // then a reload is another phone
  }
}

export class Phone {
  #name = ownName();
  #reporter = new PositionReporter();
  #isPossible = window.isSecureContext && 'geolocation' in navigator;
  #isArmed = kept(ARMED) !== null;
  #armed_ms = -Infinity;
  /** @type {PermissionState | null} */
  #permission = null;
  /** @type {number | null} */
  #watch = null;
  #isNudged = false;
  #hasFix = false;
  /** No receiver is expected of a desktop computer. */
  #isHandheld = matchMedia('(pointer: coarse)').matches;

  /** @param {import('../core/store.js').Store} store */
  constructor(store) {
    this.store = store;
    if (!this.#isPossible) this.#reporter.fail(window.isSecureContext ? 'unavailable' : 'insecure');
    const look = () => this.#look();
    store.on('tick', look);
    store.on('beat', look); // while the page is hidden frames come and its timers hardly run
    store.on('open', () => {
      this.#reporter.forget();
      look();
    });
    document.addEventListener('visibilitychange', () => this.#turn());
    window.addEventListener('pagehide', () => this.#leave());
    window.addEventListener('pageshow', look);
    // Browsers report only an earlier decision here; this query shows no prompt.
    navigator.permissions?.query({ name: 'geolocation' }).then((permission) => {
      const note = () => this.#permitted(permission.state);
      note();
      permission.onchange = note;
    }, () => {});
  }

  /** How the position stands before anything is connected. @returns {Armed} */
  get armed() {
    if (!this.#isPossible) return 'missing';
    if (this.#permission === 'denied' || this.#reporter.why(this.store.now()) === 'denied') return 'refused';
    return this.#hasFix || this.#permission === 'granted' ? 'ready' : 'asks';
  }

  /** Within the tap: the browser may ask its question now. */
  arm() {
    this.#isArmed = true;
    this.#armed_ms = this.store.now();
    keep(ARMED, 'yes');
    this.#start();
  }

  /** @param {PermissionState} state */
  #permitted(state) {
    const was = this.#permission;
    this.#permission = state;
    if (state === 'granted') {
      this.#isArmed = true; // armed once for this server: a reload needs no tap
      if (was !== null) this.#again(); // the watch ended with the permission, whatever it reports
    } else if (was === 'granted') {
      this.#stop();
      this.#reporter.fail('denied');
    }
    this.#look();
  }

  #start() {
    if (!this.#isPossible || this.#watch !== null) return;
    this.#reporter.begin(this.store.now());
    this.#watch = navigator.geolocation.watchPosition((found) => this.#found(found), (error) => this.#failed(error), OPTIONS);
  }

  #stop() {
    if (this.#watch !== null) navigator.geolocation.clearWatch(this.#watch);
    this.#watch = null;
    this.#isNudged = false;
  }

  /** @param {GeolocationPosition} found */
  #found({ coords, timestamp }) {
    if (this.#watch === null) return; // an answer to a request that no longer holds
    this.#isNudged = false;
    this.#hasFix = true;
    this.#reporter.fix(coords, timestamp, this.store.now(), Date.now());
    this.#tell();
  }

  /** @param {GeolocationPositionError} error */
  #failed({ code }) {
    if (this.#watch === null) return;
    this.#isNudged = false;
    this.#reporter.fail(whyOf(code));
    if (code === 1) this.#stop();
    this.#tell();
  }

  #look() {
    const { store } = this;
    if (!this.#isArmed) return;
    const now_ms = store.now();
    const phase = store.heeded?.session.phase;
    const isWanted = (phase !== undefined && phase !== 'idle') || now_ms - this.#armed_ms < DIALLING_MS;
    if (!isWanted) this.#stop();
    else if (this.#watch === null && !document.hidden && this.#reporter.why(now_ms) !== 'denied') this.#start();
    if (this.#watch !== null && !this.#isNudged && !document.hidden && this.#reporter.silence_ms(now_ms) > NUDGE_MS) {
      this.#isNudged = true;
      navigator.geolocation.getCurrentPosition((found) => this.#found(found), (error) => this.#failed(error), OPTIONS);
    }
    this.#tell();
  }

  #tell() {
    const { store } = this;
    const now_ms = store.now();
    const { frame } = store;
    const held_ms = now_ms - store.deadMan.heard_ms;
    if (!this.#isArmed || !frame || held_ms > ECHO_MS || !WATCHED.includes(store.heeded?.session.phase ?? '')) return;
    const report = this.#reporter.due(now_ms);
    if (!report) return;
    const message = 'fix' in report ? { fix: { ...report.fix, heard_ms: frame.server.time_ms, held_s: held_ms / 1000 } } : report;
    if (this.#send(message)) this.#reporter.sent(report, now_ms);
  }

  /** @param {object} message */
  #send(message) {
    if (this.store.isViewer) return false; // the car is compared with an operator's phone
    return this.store.socket.send({ kind: 'position', id: 'position', phone: this.#name, handheld: this.#isHandheld, ...message });
  }

  /** In the background a phone gives no position; in front again its watch may be dead without saying so. */
  #turn() {
    this.#reporter.isHidden = document.hidden;
    this.#again();
    this.#look();
  }

  /** What was refused may be allowed by now. */
  #again() {
    this.#stop();
    if (this.#isPossible) this.#reporter.begin(this.store.now());
  }

  #leave() {
    this.#stop();
    if (this.#isArmed && this.store.isMonitoring) this.#send({ why: 'off' });
    this.#reporter.forget();
  }
}
