// The texts beside the map: both fixes with their ages, the distance, the verdict of the phone–car check, the shared phones.

import { field, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { write } from '../core/ink.js';
import { bearingWords } from './map-text.js';
import { phonesLine } from '../phone/phones-layout.js';
import { age, distanceWords, fixed } from '../core/format.js';

export class MapPanel {
  #announced = '';

  /** @param {HTMLElement} root @param {import('../core/store.js').Store} store */
  constructor(root, store) {
    this.store = store;
    this.at = (/** @type {string} */ name) => field(root, name);
  }

  /** @param {import('./map.js').Known} known @param {boolean} isTooFar car and phone do not fit into one picture */
  draw({ car, phone, apart }, isTooFar) {
    const { at } = this;
    this.#drawFixes(car, phone);
    const lines = { 'car-message': car.message, 'phone-message': phone.message, 'map-message': isTooFar ? 'Car and phone are too far apart for one view.' : '' };
    for (const [name, message] of Object.entries(lines)) {
      setSentence(at(name), message);
      show(at(name), message !== '');
    }
    show(at('message'), Boolean(car.message || phone.message || isTooFar));
    this.#announce(`${car.message} ${phone.message}`.trim());
    const [number, unit] = apart ? distanceWords(apart.distance_m) : ['–', ''];
    setText(at('apart'), number);
    setText(at('apart-unit'), unit);
    setSentence(at('bearing'), apart ? `car at ${bearingWords(apart.bearing_deg)}` : '');
    setText(at('allowed'), fixed(apart?.allowed_m ?? null));
    setText(at('allowed-unit'), apart && apart.allowed_m !== null ? 'm' : '');
    this.#drawVerdict();
    this.#drawPhones();
  }

  /** @param {import('./map-text.js').CarShown} car @param {import('./map-text.js').PhoneOnMap} phone */
  #drawFixes(car, phone) {
    const { at } = this;
    const hasDigits = car.isLive || (car.ink === 'stale' && car.place !== null);
    write(at('car-lat'), car.ink, hasDigits ? degrees(car.place?.lat_deg) : '–');
    write(at('car-lon'), car.ink, degrees(car.place?.lon_deg));
    show(at('car-lon'), hasDigits);
    const carInk = car.ink === 'ageing' ? 'ageing' : car.isLive ? 'fresh' : car.place || car.age_s !== null ? 'stale' : null;
    drawAge(at('car-age'), car.age_s, carInk, car.ink !== 'stale' && !car.isLive ? 'no fix' : '');
    const phoneInk = phone.isLive ? 'fresh' : 'stale';
    write(at('phone-lat'), phone.place ? phoneInk : 'fresh', degrees(phone.place?.lat_deg));
    write(at('phone-lon'), phoneInk, degrees(phone.place?.lon_deg));
    show(at('phone-lon'), phone.place !== null);
    drawAge(at('phone-age'), phone.age_s, phone.place ? phoneInk : null);
  }

  /** Announces what is wrong once to a screen reader, not with every second of its age. @param {string} message */
  #announce(message) {
    const kind = message.replace(/\d+/g, '');
    if (kind === this.#announced) return;
    this.#announced = kind;
    setText(this.at('spoken'), message);
  }

  #drawPhones() {
    const { at, store: { frame, page } } = this;
    const isThere = (frame?.phones ?? []).length > 0;
    show(at('phones'), isThere);
    if (!frame || !isThere) return;
    const { text, why } = phonesLine(frame, page);
    setSentence(at('phones-text'), text);
    setSentence(at('phones-why'), why);
  }

  #drawVerdict() {
    const { at } = this;
    const check = this.store.frame?.checks.find(({ checks, label }) => (checks ?? []).includes('phone_car') || label === 'Phone–car');
    const verdict = check?.verdict ?? 'unknown';
    setAttribute(at('verdict'), 'class', verdict === 'fault' ? 'tag warn' : verdict === 'ok' ? 'tag' : 'tag unk');
    setAttribute(at('verdict-icon'), 'href', `#i-${verdict === 'fault' ? 'warn' : verdict === 'ok' ? 'ok' : 'unknown'}`);
    show(at('verdict-mark'), verdict !== 'unknown'); // the dashed frame shows it, and there is no room
    setText(at('verdict-text'), verdict === 'fault' ? 'FAULT' : verdict === 'ok' ? 'OK' : 'not checked');
    setSentence(at('verdict-why'), verdict === 'unknown' ? (check?.brief ?? '').replace(/^not checked:? ?/, '') : '');
  }
}

/**
 * The age of a fix beside its name: STALE when it no longer describes the present.
 * @param {HTMLElement} element
 * @param {number | null} age_s
 * @param {'fresh' | 'ageing' | 'stale' | null} ink
 * @param {string} [instead] what is worse than age
 */
function drawAge(element, age_s, ink, instead = '') {
  setAttribute(element, 'data-ink', ink);
  setSentence(element, ink === null ? '' : instead || `${ink === 'stale' ? 'STALE ' : ''}${age(age_s)} s`);
}

/** Six decimals are 0.1 m. @param {number | undefined} value */
function degrees(value) {
  return value === undefined ? '–' : `${fixed(value, 6)}°`;
}
