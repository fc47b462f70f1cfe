// The map's tab: car, track and phone in true metres, following the car until the operator moves the map.

import { field, listen, need, setAttribute, setText, show, svg } from '../core/dom.js';
import { Figure } from './map-figure.js';
import { mountGestures } from './map-gestures.js';
import { Ground } from './map-layers.js';
import { panned, zoomed } from './map-layout.js';
import { MapPanel } from './map-panel.js';
import { Track, TrackFeed } from './map-track.js';
import { MapView } from './map-view.js';
import { apartOf, carOf, phoneOf, pictureWords } from './map-text.js';
import { othersOn } from '../phone/phones-layout.js';

/**
 * @typedef {object} Known the positions of the newest frame
 * @property {import('./map-text.js').CarShown} car
 * @property {import('./map-text.js').PhoneOnMap} phone
 * @property {import('./map-text.js').Apart | null} apart
 * @property {import('./map-others.js').Other[]} others
 */

/** A drawing that was requested and did not come within this time is requested again [ms]. */
const LOST_MS = 1000;
/** Factor of one press on a zoom key. */
const KEY_ZOOM = 1.6;
/** The head that lies over the map of a tablet: right of the compass, and so high [px]. */
const HEAD_PX = { from: 64, high: 28 };
/** Time between attempts to load the layers of the map [ms]. */
const RETRY_MS = 5000;

/**
 * @param {HTMLElement} root
 * @param {import('../shell/tab-contents.js').TabPage} page
 */
export function mount(root, { store, say, isFront }) {
  const at = (/** @type {string} */ name) => field(root, name);
  at('compass').replaceChildren(svg('path', { 'data-f': 'needle', d: 'M12 -1L17 13 12 9.8 7 13Z' }), svg('text', { 'data-f': 'needle-letter', 'text-anchor': 'middle' }, 'N'));
  setText(at('none-words'), 'no position yet');
  setText(at('none-help'), 'Filled by the car’s GPS fix (NavSatFix), and by phones that share their position.');
  const tab = new MapTab(at, new MapPanel(root, store), store, isFront);
  const { map } = tab;
  const sized = new ResizeObserver(() => {
    map.size = { width: at('box').clientWidth, height: at('box').clientHeight, taken: takenOf(root, at('box')) };
    if (map.size.width && map.size.height) tab.draw();
  });
  for (const name of ['box', 'by']) sized.observe(at(name));
  const read = () => tab.read();
  const stops = [
    () => sized.disconnect(),
    mountGestures(at('box'), { isFree: () => map.isFree, pan: (dx, dy) => tab.moveTo(panned(map.view, dx, dy)), zoom: (factor, dx, dy) => tab.zoom(factor, dx, dy) }),
    listen(at('phones'), 'click', () => {
      import('../phone/phones-sheet.js').then(({ openPhones }) => openPhones(store, say)).catch(() => say('The list of phones could not be loaded.', 'Not opened'));
    }),
    listen(at('closer'), 'click', () => tab.zoom(KEY_ZOOM)),
    listen(at('wider'), 'click', () => tab.zoom(1 / KEY_ZOOM)),
    listen(at('fit'), 'click', () => tab.choose(() => map.choose(map.mode === 'both' ? 'follow' : 'both'))),
    listen(at('follow'), 'click', () => tab.choose(() => map.choose(map.mode === 'follow' ? 'free' : 'follow'))),
    listen(at('north'), 'click', () => tab.choose(() => map.turnNorth(tab.known?.car))),
    store.on('move', () => {
      tab.look();
      if (isFront()) tab.draw();
    }),
    store.on('draw', () => store.painter.inTurn(read)),
    store.on('switch', () => tab.forget()),
  ];
  tab.press();
  tab.read();
  return { stop: () => stops.forEach((stop) => stop()) };
}

class MapTab {
  map = new MapView();
  /** @type {Known | null} */
  known = null;
  /** When the next drawing was requested [ms]. */
  #due_ms = -Infinity;
  /** @type {number | null} */
  #trackNumber = null;
  #loading_ms = -Infinity;
  #hasGround = false;

  /**
   * @param {(name: string) => HTMLElement} at
   * @param {MapPanel} panel
   * @param {import('../core/store.js').Store} store
   * @param {() => boolean} isShown
   */
  constructor(at, panel, store, isShown) {
    this.at = at;
    this.panel = panel;
    this.store = store;
    this.isShown = isShown;
    const drawSoon = () => this.#drawSoon();
    this.figure = new Figure(at('under'), at('over'));
    this.ground = new Ground(at('ground'), drawSoon);
    this.feed = new TrackFeed(drawSoon);
  }

  /** Another car is shown: a map that stood still follows it, for that place is of the other one. */
  forget() {
    this.known = this.#trackNumber = null;
    this.feed.track = new Track();
    this.map.isPlaced = false;
    if (this.map.isFree) this.map.choose('follow');
    this.press();
  }

  /** Reads the frame and moves the map to what it shows; to be drawn after it. */
  look() {
    const { map, store } = this;
    if (!this.isShown() || !store.frame) return;
    const from = map.placeShown(this.known?.car.place ?? null, store.now());
    const { car, phone } = this.#learn(store.frame);
    map.steer(car, phone, this.ground.middle);
    map.move(from, car.place, store.now());
  }

  /** @param {import('../core/protocol-types.js').State} frame */
  #learn(frame) {
    const { store, feed } = this;
    const { lag_s } = store;
    const isSame = frame.session.track?.number === this.#trackNumber;
    this.#trackNumber = frame.session.track?.number ?? null;
    feed.look(frame, store.now());
    const before = (isSame ? this.known?.car.place : null) ?? feed.track.points.at(-1) ?? null;
    let car = carOf(frame, (signal) => store.ink(signal));
    // A receiver that lost its fix gives no position; the last one of the car is shown.
    if (!car.place && before && car.ink !== 'not_published' && car.ink !== 'never') car = { ...car, place: before, isLive: false, label: 'Car was here' };
    const phone = phoneOf(frame, lag_s, store.page);
    this.known = { car, phone, apart: apartOf(frame, lag_s, car, phone), others: othersOn(frame, lag_s, store.page) };
    if (!this.#hasGround && store.now() - this.#loading_ms > RETRY_MS) {
      this.#loading_ms = store.now();
      this.ground.load().then(() => { this.#hasGround = true; }, () => {});
    }
    return this.known;
  }

  #drawSoon() {
    const { store } = this;
    if (store.now() - this.#due_ms < LOST_MS || !this.isShown()) return;
    store.painter.picture(() => {
      this.#due_ms = -Infinity;
      if (this.isShown()) this.draw();
    });
    this.#due_ms = store.now();
  }

  draw() {
    const { known, map, store } = this;
    const { size } = map;
    if (!known || !size.width || !size.height) return;
    const place = map.placeShown(known.car.place, store.now());
    map.advance(store.now());
    const car = place && known.car.place ? { ...known.car, place } : known.car;
    this.figure.draw({ ...known, view: map.view, size, car, track: this.feed.track });
    this.ground.draw(map.view, size);
    this.#drawNorth(map.view.up_deg);
    if (map.step) this.#drawSoon();
  }

  /** Turns the needle with the map; its letter stays upright. @param {number} up_deg */
  #drawNorth(up_deg) {
    const turn = (-up_deg * Math.PI) / 180;
    setAttribute(this.at('needle'), 'transform', `rotate(${(-up_deg).toFixed(1)} 12 12)`);
    setAttribute(this.at('needle-letter'), 'x', (12 - 12 * Math.sin(turn)).toFixed(1));
    setAttribute(this.at('needle-letter'), 'y', (16.2 + 12 * Math.cos(turn)).toFixed(1));
  }

  /** Writes what is read, five times a second. */
  read() {
    const { at, map, store } = this;
    if (!this.isShown() || !store.frame) return;
    if (this.known) this.#learn(store.frame);
    else this.look();
    this.draw();
    if (!this.known) return;
    show(at('none'), !map.isPlaced);
    this.panel.draw(this.known, map.isTooFar);
    setText(at('by'), this.ground.caption(map.aim));
    this.figure.describe(pictureWords(this.known.car, this.known.phone, this.known.apart));
  }

  /** Changes how the map follows, then shows it. @param {() => void} change */
  choose(change) {
    change();
    this.press();
    this.look();
    this.#drawSoon();
  }

  /** Shows a view that the operator chose. @param {import('./map-layout.js').View} view */
  moveTo(view) {
    this.map.set(view);
    this.press();
    if (!this.map.isFree) this.look();
    this.#drawSoon();
  }

  /** Zooms about a point; what is followed stays in the middle. @param {number} factor @param {number} [dx] @param {number} [dy] from the middle [px] */
  zoom(factor, dx = 0, dy = 0) {
    const { map } = this;
    this.moveTo(map.isFree ? zoomed(map.view, factor, dx, dy) : zoomed(map.aim, factor, 0, 0));
  }

  /** Shows which keys are pressed. */
  press() {
    const { at, map } = this;
    setAttribute(at('map'), 'data-mode', map.mode);
    setAttribute(at('follow'), 'aria-pressed', String(map.mode === 'follow'));
    setAttribute(at('fit'), 'aria-pressed', String(map.mode === 'both'));
    setAttribute(at('north'), 'aria-pressed', String(map.isHeadingUp));
  }
}

/** What lies over the map: the keys, whose map it is, and the head of its pane where it is no row of its own. @param {HTMLElement} root @param {HTMLElement} box of the map */
function takenOf(root, box) {
  const { left, top, width } = box.getBoundingClientRect();
  const over = [...root.querySelectorAll('.fab, .map-by')].map((one) => one.getBoundingClientRect());
  const head = root.querySelector(':scope > .ph');
  const isOver = head !== null && getComputedStyle(head).position === 'absolute';
  const strip = { left: HEAD_PX.from, top: 0, width, height: HEAD_PX.high };
  return [...over.filter((one) => one.width).map((one) => ({ left: one.left - left, top: one.top - top, width: one.width, height: one.height })), ...(isOver ? [strip] : [])];
}
