// What the map looks at: it follows the car, fits car and phone, or stays where the operator moved it. The choice is stored.

import { distance_m } from '../core/geodesy.js';
import { FIRST, between, bounded, fitted, placeBetween, upOf } from './map-layout.js';

/**
 * @typedef {import('../core/geodesy.js').Place} Place
 * @typedef {import('./map-layout.js').View} View
 * @typedef {'follow' | 'both' | 'free'} Mode
 */

const STORED = 'catgraph.map';
/** Duration of a movement to a new place [ms]. */
const FOLLOW_MS = 100;
/** A longer distance is not shown as a movement [px]. */
const LEAP_PX = 120;

export class MapView {
  /** @type {Mode} */
  mode;
  /** @type {import('./map-layout.js').Size} */
  size = { width: 0, height: 0 };
  /** Whether there is anything to look at. */
  isPlaced = false;
  /** Whether car and phone do not fit into one picture. */
  isTooFar = false;
  /** A movement under way: from the last place of the car to its newest. @type {{from: Place, to: Place, view: View, began_ms: number} | null} */
  step = null;

  constructor() {
    const { mode, isHeadingUp, mpp } = recall();
    this.mode = mode;
    this.isHeadingUp = isHeadingUp;
    /** Where the movement ends. @type {View} */
    this.aim = { centre: { lat_deg: 0, lon_deg: 0 }, mpp, up_deg: 0 };
    /** What is shown now. */
    this.view = this.aim;
  }

  get isFree() {
    return this.mode === 'free';
  }

  /** @param {Mode} mode */
  choose(mode) {
    this.mode = mode;
    remember(this);
  }

  /** @param {import('./map-text.js').CarShown | undefined} car */
  turnNorth(car) {
    this.isHeadingUp = !this.isHeadingUp;
    this.#turn(car);
    remember(this);
  }

  /** @param {import('./map-text.js').CarShown | undefined} car */
  #turn(car) {
    this.aim = { ...this.aim, up_deg: upOf(this.aim.up_deg, this.isHeadingUp, car?.isHeadingLive ? car.heading_deg : null) };
  }

  /** Moves to a view that the operator chose. @param {View} wanted */
  set(wanted) {
    this.step = null;
    this.view = this.aim = wanted;
    this.choose(this.mode === 'both' ? 'follow' : this.mode); // fitting both would undo the operator's scale
  }

  /**
   * Aims at what the mode wants to see.
   * @param {import('./map-text.js').CarShown} car
   * @param {import('./map-text.js').PhoneOnMap} phone
   * @param {Place | null} middle of the site's image
   */
  steer(car, phone, middle) {
    this.isTooFar = false;
    if (!this.isFree) this.#turn(car);
    const centre = car.place ?? phone.place ?? middle;
    if (!centre) return;
    if (this.mode === 'both' && car.place && phone.place) {
      const around_m = Math.max(car.ellipse?.major_m ?? 0, phone.accuracy_m ?? 0);
      const { fits, ...found } = fitted(this.aim, this.size, car.place, phone.place, around_m);
      this.aim = found;
      this.isTooFar = !fits;
    } else if (!this.isFree || !this.isPlaced) this.aim = { ...this.aim, centre };
    this.isPlaced = true;
  }

  /** Begins the movement of the car from its shown place to its newest one. @param {Place | null} from @param {Place | null} to @param {number} now_ms */
  move(from, to, now_ms) {
    const { aim, view } = this;
    const leap_px = from && to ? distance_m(from, to) / aim.mpp : 0;
    const shift_px = distance_m(view.centre, aim.centre) / aim.mpp;
    const isStill = matchMedia('(prefers-reduced-motion: reduce)').matches;
    const isFar = shift_px > Math.max(LEAP_PX, this.size.height);
    // A movement below half a pixel is invisible: a car that stands costs no drawing.
    const isHere = Math.max(leap_px, shift_px) < 0.5 && view.mpp === aim.mpp && view.up_deg === aim.up_deg;
    this.step = !from || !to || isStill || isHere || leap_px > LEAP_PX || isFar ? null : { from, to, view, began_ms: now_ms };
    if (!this.step) this.view = aim;
  }

  /** Shows the view of this moment. @param {number} now_ms */
  advance(now_ms) {
    const share = this.#share(now_ms);
    this.view = this.step ? between(this.step.view, this.aim, share) : this.aim;
    if (share >= 1) this.step = null;
  }

  /** The shown place of the car, during a movement too. @param {Place | null} place its newest @param {number} now_ms */
  placeShown(place, now_ms) {
    return this.step ? placeBetween(this.step.from, this.step.to, this.#share(now_ms)) : place;
  }

  /** The part of the movement that is done, 0 to 1. @param {number} now_ms */
  #share(now_ms) {
    return this.step ? Math.min(1, Math.max(0, (now_ms - this.step.began_ms) / FOLLOW_MS)) : 1;
  }
}

/** @returns {{mode: Mode, isHeadingUp: boolean, mpp: number}} */
function recall() {
  try {
    const { mode, isHeadingUp, mpp } = JSON.parse(localStorage.getItem(STORED) ?? '{}');
    return { mode: mode === 'both' ? 'both' : 'follow', isHeadingUp: isHeadingUp === true, mpp: bounded(Number(mpp) || FIRST) };
  } catch {
    return { mode: 'follow', isHeadingUp: false, mpp: FIRST };
  }
}

/** Stores the choice. A free map is not restored: a later visit begins with the car. @param {MapView} map */
function remember({ mode, isHeadingUp, aim }) {
  try {
    localStorage.setItem(STORED, JSON.stringify({ mode, isHeadingUp, mpp: aim.mpp }));
  } catch {
    // without storage the choice is lost
  }
}
