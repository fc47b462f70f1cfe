// The texts of the car and of the phone on the map, and the freshness of each: pure functions of the newest frame.

import { placeOf } from '../core/geodesy.js';
import { ellipseOf } from './map-layout.js';
import { nameOf } from '../phone/phones-layout.js';
import { local } from '../core/decimal.js';
import { age, distanceWords, fixed, heading } from '../core/format.js';

/**
 * @typedef {import('../core/geodesy.js').Place} Place
 * @typedef {import('../core/protocol-types.js').State} State
 * @typedef {import('../core/freshness.js').Ink} Freshness
 * @typedef {object} CarShown
 * @property {Place | null} place where it was last known to be
 * @property {boolean} isLive the place may be shown as where it is
 * @property {Freshness} ink
 * @property {number | null} age_s
 * @property {import('./map-layout.js').Ellipse | null} ellipse one sigma
 * @property {number | null} heading_deg
 * @property {boolean} isHeadingLive
 * @property {string} label on the map
 * @property {string} message why it is not current, else ""
 *
 * @typedef {object} PhoneOnMap
 * @property {Place | null} place
 * @property {boolean} isLive
 * @property {number | null} age_s
 * @property {number | null} accuracy_m
 * @property {string} label
 * @property {string} message
 *
 * @typedef {{distance_m: number, bearing_deg: number, allowed_m: number | null}} Apart allowed_m: null where the server names none
 */

/** A phone's fix older than this tells where it was, not where it is; as the server has it [s]. */
const PHONE_LIVES_S = 5;
/** A comparison older than this is of another moment [s]. */
export const COMPARED_LIVES_S = 5;

/**
 * The car as the newest frame has it.
 * @param {State} frame
 * @param {(signal: string) => {ink: Freshness, age_s: number | null}} freshnessStyle
 * @returns {CarShown}
 */
export function carOf(frame, freshnessStyle) {
  const { ink, age_s } = freshnessStyle('position');
  const fix = frame.signals['position']?.value ?? null;
  const hasFix = fix !== null && !(typeof fix['status'] === 'number' && fix['status'] < 0);
  const place = hasFix ? placeOf(fix) : null;
  const isLive = place !== null && (ink === 'fresh' || ink === 'ageing');
  const ellipse = hasFix ? ellipseOf(fix['covariance_m2'], fix['sigma_m']) : null;
  const turn = freshnessStyle('heading');
  const measured_deg = frame.signals['heading']?.value?.['heading_deg'];
  const heading_deg = typeof measured_deg === 'number' && Number.isFinite(measured_deg) ? measured_deg : null;
  const isHeadingLive = heading_deg !== null && (turn.ink === 'fresh' || turn.ink === 'ageing');
  const unknown = [...(ellipse ? [] : ['accuracy']), ...(heading_deg === null ? ['heading'] : [])];
  const known = [
    ellipse ? `Car ±${metres(ellipse.major_m)}` : 'Car',
    ...(unknown.length ? [`${unknown.join(' and ')} unknown`] : []),
    ...(heading_deg !== null && !isHeadingLive ? [`heading ${age(turn.age_s)} s old`] : []),
  ].join(', ');
  return {
    place, isLive, ink, age_s, ellipse,
    heading_deg, isHeadingLive,
    label: isLive ? known : `Car STALE ${age(age_s)} s`,
    message: carMessage(ink, age_s, fix !== null && !hasFix),
  };
}

/** @param {Freshness} ink @param {number | null} age_s @param {boolean} isLost */
function carMessage(ink, age_s, isLost) {
  if (ink === 'not_published') return 'The car publishes no position.';
  if (ink === 'no_value' || ink === 'not_measured') return 'The car’s messages hold no usable position.';
  if (ink === 'never') return 'No position received from the car yet.'; // a track of before has the map placed, and no words over it
  if (ink === 'stale') return `The car’s position is ${age(age_s)} s old: the car may be elsewhere.`;
  if (isLost) return 'The car’s receiver has no fix: the car’s position is unknown.';
  return '';
}

/**
 * The phone as the newest frame has it.
 * @param {State} frame
 * @param {number} lag_s age of the frame at the glass
 * @param {string} [page] this page
 * @returns {PhoneOnMap}
 */
export function phoneOf(frame, lag_s, page = '') {
  const phone = frame.phone ?? null;
  if (!phone) return { place: null, isLive: false, age_s: null, accuracy_m: null, label: '', message: 'No phone is sharing its position.' };
  const age_s = phone.age_s === null ? null : phone.age_s + lag_s;
  const place = placeOf(phone);
  // A coarse fix is one of now all the same; every other reason means that there is none of now.
  const isLive = place !== null && (phone.used || phone.why === 'coarse') && age_s !== null && age_s <= PHONE_LIVES_S;
  const name = phone.count > 1 ? nameOf(phone, page) : 'Phone'; // among several each has its own
  const whose = phone.count > 1 && phone.label ? ` Compared with ${phone.label}, one of ${phone.count} phones.` : '';
  let message = '';
  if (phone.why_text) message = `${phone.why_text}.`;
  else if (place && !isLive) message = `The phone’s newest fix is ${age(age_s)} s old.`;
  return {
    place, isLive, age_s, accuracy_m: phone.accuracy_m,
    label: isLive ? `${name} ±${metres(phone.accuracy_m ?? 0)}${phone.used ? '' : ', too coarse'}` : `${name} STALE ${age(age_s)} s`,
    message: `${message}${whose}`.trim(),
  };
}

/**
 * How far car and phone are apart, and where the car is from the phone: as the server compared them, for one moment. Where it
 * did not, two fixes of two moments or a coarse one give no distance, here as on Home.
 * @param {State} frame
 * @param {number} lag_s
 * @param {CarShown} car
 * @param {PhoneOnMap} phone
 * @returns {Apart | null}
 */
export function apartOf(frame, lag_s, car, phone) {
  if (!car.isLive || !phone.isLive || !car.place || !phone.place) return null;
  const compared = frame.phone;
  if (!compared?.used || typeof compared.apart_m !== 'number' || typeof compared.bearing_deg !== 'number' || (compared.compared_age_s ?? Infinity) + lag_s > COMPARED_LIVES_S) return null;
  const least_m = frame.limits['phone_car.least_m'];
  return { distance_m: compared.apart_m, bearing_deg: compared.bearing_deg, allowed_m: compared.explained_m === null ? null : Math.max(compared.explained_m, typeof least_m === 'number' ? least_m : 0) };
}

/** A bearing as it is read: "323° NW". @param {number} bearing */
export function bearingWords(bearing) {
  const { degrees, point } = heading(bearing);
  return `${degrees} ${point}`;
}

/** The text of the picture for a screen reader. @param {CarShown} car @param {PhoneOnMap} phone @param {Apart | null} apart */
export function pictureWords(car, phone, apart) {
  if (apart) return `Map: the car is ${distanceWords(apart.distance_m).join(' ')} from the phone, at ${bearingWords(apart.bearing_deg)} of it`;
  const seen = [car.isLive ? 'the car' : '', phone.isLive ? 'the phone' : ''].filter(Boolean);
  if (seen.length) return `Map: ${seen.join(' and ')}`;
  return car.place || phone.place ? 'Map: no current position' : 'Map: no position';
}

/** "5 m", "4.2 m", "120 m". @param {number} value_m */
function metres(value_m) {
  return value_m < 9.95 ? `${local(String(Math.round(value_m * 10) / 10))} m` : distanceWords(Math.round(value_m)).join(' ').replace(/[.,]0 /, ' ');
}
