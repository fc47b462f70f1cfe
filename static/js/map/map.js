// The map's tab: car, track and phone in true metres, following the car until the operator frees it.

import { field, listen, setAttribute, setText, setWords, show, svg } from '../core/dom.js';
import { write } from '../core/ink.js';
import { distance_m } from '../core/geodesy.js';
import { Figure } from './map-figure.js';
import { mountGestures } from './map-gestures.js';
import { Ground } from './map-layers.js';
import { FIRST, between, bounded, fitted, panned, placeBetween, upOf, zoomed } from './map-layout.js';
import { TrackFeed } from './map-track.js';
import { apartOf, bearingWords, carOf, distanceWords, phoneOf, pictureWords } from './map-text.js';
import { othersOn, phonesLine } from '../phone/phones-layout.js';
import { age, fixed } from '../core/format.js';

/**
 * @typedef {import('../core/geodesy.js').Place} Place
 * @typedef {import('./map-layout.js').View} View
 * @typedef {'follow' | 'both' | 'free'} Mode
 */

const REMEMBERED = 'catgraph.map';
/** Pointers follow in so long [ms]; what goes farther than this is no movement but a leap [px]. */
const FOLLOW_MS = 100;
/** A drawing that was asked for and did not come within this time is asked for again [ms]. */
const LOST_MS = 1000;
const LEAP_PX = 120;
/** A key makes the map so much larger. */
const KEY_ZOOM = 1.6;
/** The ground is asked for again after so long, if it did not come [ms]. */
const AGAIN_MS = 5000;

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @param {() => boolean} isShown
 * @param {(sentence: string, title?: string) => void} [say]
 */
export function mount(root, store, isShown, say = () => {}) {
  const at = (/** @type {string} */ name) => field(root, name);
  const [frameElement, box, none] = [at('map'), at('box'), at('none')];
  const figure = new Figure(at('under'), at('over'));
  const ground = new Ground(at('ground'), drawSoon);
  const feed = new TrackFeed(document.documentElement.dataset['vehicle'] ?? '', drawSoon);
  const kept = recall();
  /** @type {Mode} */
  let mode = kept.mode;
  let isHeadingUp = kept.isHeadingUp;
  /** What is aimed at, and what stands on the glass on its way there. @type {View} */
  let aim = { centre: { lat_deg: 0, lon_deg: 0 }, mpp: kept.mpp, up_deg: 0 };
  let view = aim;
  let isPlaced = false;
  let isTooFar = false;
  let size = { width: 0, height: 0 };
  /** @type {{car: import('./map-text.js').CarShown, phone: import('./map-text.js').PhoneOnMap, apart: import('./map-text.js').Apart | null, others: import('./map-others.js').Other[]} | null} */
  let known = null;
  /** The last place of the car on the glass, and where it goes. @type {{from: Place, to: Place, view: View, began_ms: number} | null} */
  let step = null;
  /** When the next drawing was asked for. */
  let due_ms = -Infinity;
  let spoken = '';
  /** @type {number | null} */
  let trackNumber = null;
  let asked_ms = -Infinity;
  let isGroundThere = false;

  // -- what is known now ------------------------------------------------------------------------------------------------

  /** Another frame, or another wish: look there. */
  function look() {
    if (!isShown() || !store.frame) return;
    const stood = shownPlace();
    learn(store.frame);
    steer();
    move(stood);
  }

  /** @param {import('../core/protocol.js').State} frame */
  function learn(frame) {
    const lag_s = store.lag_s;
    const isSame = frame.session.track?.number === trackNumber;
    trackNumber = frame.session.track?.number ?? null;
    feed.look(frame, store.now());
    const before = (isSame ? known?.car.place : null) ?? feed.track.points.at(-1) ?? null;
    let car = carOf(frame, (signal) => store.ink(signal));
    // A receiver that lost its fix tells no place any more; what is left is where the car was last.
    if (!car.place && before && car.ink !== 'not_published' && car.ink !== 'never') car = { ...car, place: before, isLive: false, label: 'Car was here' };
    const phone = phoneOf(frame, lag_s, store.page);
    known = { car, phone, apart: apartOf(frame, lag_s, car, phone), others: othersOn(frame, lag_s, store.page) };
    if (!isGroundThere && store.now() - asked_ms > AGAIN_MS) {
      asked_ms = store.now();
      ground.load().then(() => { isGroundThere = true; }, () => {});
    }
  }

  /** Where the map is to look, as the mode has it. */
  function steer() {
    if (!known) return;
    const { car, phone } = known;
    isTooFar = false;
    if (mode !== 'free') aim = { ...aim, up_deg: upOf(aim.up_deg, isHeadingUp, car.isHeadingLive ? car.heading_deg : null) };
    const centre = car.place ?? phone.place ?? ground.middle;
    if (!centre) return;
    if (mode === 'both' && car.place && phone.place) {
      const around_m = Math.max(car.ellipse?.major_m ?? 0, phone.accuracy_m ?? 0);
      const { fits, ...found } = fitted(aim, size, car.place, phone.place, around_m);
      aim = found;
      isTooFar = !fits;
    } else if (mode !== 'free' || !isPlaced) aim = { ...aim, centre };
    isPlaced = true;
  }

  /** From where things stand on the glass to where they are now: what moves is seen to move. @param {Place | null} from */
  function move(from) {
    const to = known?.car.place ?? null;
    const leap_px = from && to ? distance_m(from, to) / aim.mpp : 0;
    const isStill = matchMedia('(prefers-reduced-motion: reduce)').matches;
    const isFar = distance_m(view.centre, aim.centre) / aim.mpp > Math.max(LEAP_PX, size.height);
    // Half a pixel is not seen to move: a car that stands costs no drawing.
    const isHere = Math.max(leap_px, distance_m(view.centre, aim.centre) / aim.mpp) < 0.5 && view.mpp === aim.mpp && view.up_deg === aim.up_deg;
    step = !from || !to || isStill || isHere || leap_px > LEAP_PX || isFar ? null : { from, to, view, began_ms: store.now() };
    if (!step) view = aim;
    drawSoon();
  }

  function share() {
    return step ? Math.min(1, Math.max(0, (store.now() - step.began_ms) / FOLLOW_MS)) : 1;
  }

  /** Where the car stands on the glass. @returns {Place | null} */
  function shownPlace() {
    return step ? placeBetween(step.from, step.to, share()) : (known?.car.place ?? null);
  }

  // -- drawing ----------------------------------------------------------------------------------------------------------

  function drawSoon() {
    if (store.now() - due_ms < LOST_MS || !isShown()) return;
    store.painter.picture(() => {
      due_ms = -Infinity;
      if (isShown()) draw();
    });
    due_ms = store.now();
  }

  function draw() {
    if (!known || !size.width || !size.height) return;
    const done = share();
    const place = shownPlace();
    view = step ? between(step.view, aim, done) : aim;
    if (done >= 1) step = null;
    const { phone, apart, others } = known;
    const car = place && known.car.place ? { ...known.car, place } : known.car;
    figure.draw({ view, size, car, phone, apart, others, track: feed.track });
    ground.draw(view, size);
    drawNorth();
    if (step) drawSoon();
  }

  /** The needle turns with the map, its letter stays upright. */
  function drawNorth() {
    const turn = (-view.up_deg * Math.PI) / 180;
    setAttribute(at('needle'), 'transform', `rotate(${(-view.up_deg).toFixed(1)} 12 12)`);
    setAttribute(at('needle-letter'), 'x', (12 - 12 * Math.sin(turn)).toFixed(1));
    setAttribute(at('needle-letter'), 'y', (16.2 + 12 * Math.cos(turn)).toFixed(1));
  }

  /** What is read, five times a second. */
  function read() {
    if (!isShown() || !store.frame) return;
    if (known) learn(store.frame);
    else look();
    drawSoon();
    if (!known) return;
    const { car, phone, apart } = known;
    show(none, !isPlaced);
    const hasDigits = car.isLive || (car.ink === 'stale' && car.place !== null);
    write(at('car-lat'), car.ink, hasDigits ? degrees(car.place?.lat_deg) : '–');
    write(at('car-lon'), car.ink, degrees(car.place?.lon_deg));
    show(at('car-lon'), hasDigits);
    aged(at('car-age'), car.age_s, car.ink === 'ageing' ? 'ageing' : car.isLive ? 'fresh' : car.place || car.age_s !== null ? 'stale' : null, car.ink !== 'stale' && !car.isLive ? 'no fix' : '');
    const phoneInk = phone.isLive ? 'fresh' : 'stale';
    write(at('phone-lat'), phone.place ? phoneInk : 'fresh', phone.place ? degrees(phone.place.lat_deg) : '–');
    write(at('phone-lon'), phoneInk, degrees(phone.place?.lon_deg));
    show(at('phone-lon'), phone.place !== null);
    aged(at('phone-age'), phone.age_s, phone.place ? phoneInk : null);
    for (const [name, says] of /** @type {[string, string][]} */ ([['car-says', car.says], ['phone-says', phone.says], ['map-says', isTooFar ? 'Car and phone are too far apart for one picture.' : '']])) {
      setWords(at(name), says);
      show(at(name), says !== '');
    }
    show(at('says'), Boolean(car.says || phone.says || isTooFar));
    speak(`${car.says} ${phone.says}`.trim());
    const [number, unit] = apart ? distanceWords(apart.distance_m) : ['–', ''];
    setText(at('apart'), number);
    setText(at('apart-unit'), unit);
    setWords(at('bearing'), apart ? `car at ${bearingWords(apart.bearing_deg)}` : '');
    setText(at('allowed'), fixed(apart?.allowed_m ?? null));
    setText(at('allowed-unit'), apart && apart.allowed_m !== null ? 'm' : '');
    readVerdict();
    readPhones();
    setText(at('by'), ground.words(aim));
    figure.describe(pictureWords(car, phone, apart));
  }

  /** A reader hears what is wrong once, not again with every second that it grows older. @param {string} says */
  function speak(says) {
    const kind = says.replace(/\d+/g, '');
    if (kind === spoken) return;
    spoken = kind;
    setText(at('spoken'), says);
  }

  function readPhones() {
    const { frame } = store;
    const isThere = (frame?.phones ?? []).length > 0;
    show(at('phones'), isThere);
    if (!frame || !isThere) return;
    const { text, why } = phonesLine(frame, store.page);
    setWords(at('phones-text'), text);
    setWords(at('phones-why'), why);
  }

  function readVerdict() {
    const check = store.frame?.checks.find(({ checks, label }) => (checks ?? []).includes('phone_car') || label === 'Phone–car');
    const verdict = check?.verdict ?? 'unknown';
    const tag = at('verdict');
    setAttribute(tag, 'class', verdict === 'fault' ? 'tag warn' : verdict === 'ok' ? 'tag' : 'tag unk');
    setAttribute(at('verdict-icon'), 'href', `#i-${verdict === 'fault' ? 'warn' : verdict === 'ok' ? 'ok' : 'unknown'}`);
    show(at('verdict-mark'), verdict !== 'unknown'); // its dashes say it, and there is no room
    setText(at('verdict-word'), verdict === 'fault' ? 'FAULT' : verdict === 'ok' ? 'OK' : 'not checked');
    setWords(at('verdict-why'), verdict === 'unknown' ? (check?.brief ?? '').replace(/^not checked:? ?/, '') : '');
  }

  // -- the operator's wishes --------------------------------------------------------------------------------------------

  /** @param {Mode} wanted */
  function choose(wanted) {
    mode = wanted;
    press();
    look();
  }

  function press() {
    setAttribute(frameElement, 'data-mode', mode);
    setAttribute(at('follow'), 'aria-pressed', String(mode === 'follow'));
    setAttribute(at('fit'), 'aria-pressed', String(mode === 'both'));
    setAttribute(at('north'), 'aria-pressed', String(isHeadingUp));
    remember({ mode, isHeadingUp, mpp: aim.mpp });
  }

  /** @param {View} wanted */
  function hand(wanted) {
    step = null;
    view = aim = wanted;
    if (mode === 'both') mode = 'follow'; // a scale of the operator's own
    press();
    if (mode === 'free') drawSoon();
    else look();
  }

  /** Zooming keeps in the middle what is followed. @param {number} factor @param {number} [dx] @param {number} [dy] */
  function zoom(factor, dx = 0, dy = 0) {
    const isFree = mode === 'free';
    hand(zoomed(isFree ? view : aim, factor, isFree ? dx : 0, isFree ? dy : 0));
  }

  const sized = new ResizeObserver(() => {
    size = { width: box.clientWidth, height: box.clientHeight };
    if (size.width && size.height) draw();
  });
  sized.observe(box);
  const stops = [
    () => sized.disconnect(),
    mountGestures(box, { isFree: () => mode === 'free', pan: (dx, dy) => hand(panned(view, dx, dy)), zoom }),
    listen(at('phones'), 'click', () => {
      import('../phone/phones-sheet.js').then(({ openPhones }) => openPhones(store, say)).catch(() => say('What shows the phones could not be fetched.', 'Not opened'));
    }),
    listen(at('closer'), 'click', () => zoom(KEY_ZOOM)),
    listen(at('wider'), 'click', () => zoom(1 / KEY_ZOOM)),
    listen(at('fit'), 'click', () => choose(mode === 'both' ? 'follow' : 'both')),
    listen(at('follow'), 'click', () => choose(mode === 'follow' ? 'free' : 'follow')),
    listen(at('north'), 'click', () => {
      isHeadingUp = !isHeadingUp;
      aim = { ...aim, up_deg: upOf(aim.up_deg, isHeadingUp, known?.car.isHeadingLive ? known.car.heading_deg : null) };
      press();
      look();
    }),
    store.on('move', look),
    store.on('draw', read),
  ];
  at('compass').replaceChildren(svg('path', { 'data-f': 'needle', d: 'M12 -1L17 13 12 9.8 7 13Z' }), svg('text', { 'data-f': 'needle-letter', 'text-anchor': 'middle' }, 'N'));
  press();
  setText(at('none-words'), 'no position yet');
  read();

  return () => stops.forEach((stop) => stop());
}

/**
 * The age of a fix beside its name: STALE where it says nothing of now.
 * @param {HTMLElement} element
 * @param {number | null} age_s
 * @param {'fresh' | 'ageing' | 'stale' | null} ink
 * @param {string} [instead] what is worse than age
 */
function aged(element, age_s, ink, instead = '') {
  setAttribute(element, 'data-ink', ink);
  setWords(element, ink === null ? '' : instead || `${ink === 'stale' ? 'STALE ' : ''}${age(age_s)} s`);
}

/** Six decimals are 0.1 m. @param {number | undefined} value */
function degrees(value) {
  return value === undefined ? '–' : fixed(value, 6);
}

/** @returns {{mode: Mode, isHeadingUp: boolean, mpp: number}} */
function recall() {
  try {
    const { mode, isHeadingUp, mpp } = JSON.parse(localStorage.getItem(REMEMBERED) ?? '{}');
    return { mode: mode === 'both' ? 'both' : 'follow', isHeadingUp: isHeadingUp === true, mpp: bounded(Number(mpp) || FIRST) };
  } catch {
    return { mode: 'follow', isHeadingUp: false, mpp: FIRST };
  }
}

/** Free is of the moment: a map that does not follow is not what one comes back to. @param {{mode: Mode, isHeadingUp: boolean, mpp: number}} choice */
function remember(choice) {
  try {
    localStorage.setItem(REMEMBERED, JSON.stringify(choice));
  } catch {
    // no storage: forgotten
  }
}
