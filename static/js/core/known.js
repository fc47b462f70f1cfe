// What the newest messages of the server say, without a look at the time: the car, its frame, the other cars, who this page is.

import { controlOf, liveOf } from './live-car.js';

/**
 * @typedef {import('./store.js').State} State
 * @typedef {import('./store.js').Signals} Signals
 */

/**
 * @template {string} Name
 * @typedef {Name extends keyof Signals ? Signals[Name] : import('./protocol-types.js').SignalState<any>} SignalOf
 */

export class Known {
  /** @type {State | null} */
  frame = null;
  /** Wall clock of the last fresh frame. @type {number | null} */
  heard_ms = null;
  /** The car that this page shows, and no other: frames of any other are refused. '' until the server names it. */
  vehicle = '';
  /** Every car of the server, by name. @type {string[]} */
  vehicles = [];
  /** All cars of the server, where it has several. @type {import('./protocol-types.js').Cars | null} */
  cars = null;
  /** The page shows a recording: frames of the live car are none of it, nor the other way round. */
  replaying = false;
  /** What was chosen for the replay that is shown. @type {{topics: Record<string, string>, units: Record<string, string>}} */
  judgedBy = { topics: {}, units: {} };
  /** Who this page is to the server. @type {import('./protocol-types.js').Hello['who'] | null} */
  who = null;
  /** Who is on duty at this device; null: not received yet. @type {import('./protocol-types.js').Duty | null} */
  duty = null;
  /** The build of the page that the server has now; '' where it cannot say. */
  build = '';
  /** Why nothing comes from the car's agent although the server answers; '' where nothing is known of it. */
  unserved = '';

  /** Nothing is known yet of the car that is shown from now on. @param {string} vehicle */
  turnTo(vehicle) {
    this.vehicle = vehicle;
    this.unserved = '';
    this.frame = this.heard_ms = null;
    this.replaying = false;
  }

  /** A fresh frame came. @param {State} frame @param {number} heard_ms by the wall clock @returns {boolean} whether it is the first of the car */
  take(frame, heard_ms) {
    const isFirst = this.frame === null;
    this.frame = frame;
    this.heard_ms = heard_ms;
    this.unserved = '';
    return isFirst;
  }

  /** The list of all cars came; a web node finds more of them over time. @param {import('./protocol-types.js').Cars} cars */
  list(cars) {
    this.cars = cars;
    this.vehicles = cars.cars.map(({ name }) => name);
  }

  /** The server greets. @param {import('./protocol-types.js').Hello} hello @returns {boolean} whether for the car that is shown */
  greet({ vehicle, vehicles, who, build }) {
    if (this.vehicle && vehicle !== this.vehicle) {
      console.warn('The server answers for another car:', vehicle);
      return false;
    }
    Object.assign(this, { vehicle, vehicles, who: who ?? null, build: build ?? '' });
    return true;
  }

  /** Is the vehicle being monitored, as far as the page knows? */
  get isMonitoring() {
    return this.frame?.session.phase === 'monitoring' || this.frame?.session.phase === 'lost';
  }

  /** This device was let in to look, and no more. */
  get isViewer() {
    return this.who?.role === 'viewer';
  }

  /** The name under which this page's orders are logged; '' before the server has sent it. */
  get signs() {
    return this.duty?.signs ?? '';
  }

  /** The car whose alarms must be announced: the live one, also while a recording is shown. @returns {State | null} */
  get heeded() {
    return liveOf(this.frame);
  }

  /** Who is in control of the live car, also while a recording is shown. */
  get control() {
    return controlOf(this.frame);
  }

  /** A signal of the newest frame. @template {string} Name @param {Name} name @returns {SignalOf<Name> | undefined} */
  signal(name) {
    return /** @type {any} */ (this.frame?.signals)?.[name];
  }

  /** A limit of the newest frame, or null. @param {string} name */
  limit(name) {
    const value = this.frame?.limits[name];
    return typeof value === 'number' ? value : null;
  }
}
