// Draws the map's figure: grid, track, car, phone, the way between them and the scale, in true metres as SVG. Letters stay
// upright, however the map is turned.

import { offsetOf, placeAt, turned } from '../core/geodesy.js';
import { setAttribute, svg } from '../core/dom.js';
import { distanceWords } from '../core/format.js';
import { clearBox, clearTop, gridPaths, groundMatrix, linesOf, overlap, pixelOf, round, scaleBar_m, turnedPixels } from './map-layout.js';
import { OtherPhones } from './map-others.js';
import { trackPaths } from './map-track.js';
import { bearingWords } from './map-text.js';

/**
 * @typedef {import('../core/geodesy.js').Place} Place
 * @typedef {import('./map-layout.js').View} View
 * @typedef {import('./map-layout.js').Size} Size
 * @typedef {import('./map-layout.js').Pixel} Pixel
 * @typedef {object} Shown
 * @property {View} view
 * @property {Size} size
 * @property {import('./map-text.js').CarShown} car
 * @property {import('./map-text.js').PhoneOnMap} phone
 * @property {import('./map-text.js').Apart | null} apart
 * @property {import('./map-track.js').Track} track
 * @property {import('./map-others.js').Other[]} [others] phones beside the one that is compared
 */

/** The track's paths are in metres of a plane that is good so far around [m]; where meridians meet, less far. */
const ANCHOR_M = 2000;
/** The last piece, from the track's newest point to the car, is drawn up to this length [m]. */
const TAIL_M = 60;
/** A letter of a name is about so wide [px]; a name is kept inside the map. */
const LETTER_PX = 7.6;
/** So wide is the column of keys at the right [px]. */
const KEYS_PX = 70;
/** Lower, the compass and the scale are one above the other [px]. */
const LOW_PX = 120;
/** A lower map hides labels that have no clear place [px]. */
const HIDING_PX = 200;
/** Half the side of a mark [px]. */
const MARK_PX = 16;
/** The room of a name: above its base line, and all [px]. */
const NAME_PX = { up: 14, high: 19 };
/** The name of a phone stands outside the circle of its accuracy up to this radius, inside a wider one [px]. */
const WIDE_PX = 56;
/** From one line of a name to the next [px]. */
const LINE_PX = 17;
/** Marks nearer than this leave no room for a number between them [px]. */
const ROOM_PX = 70;

export class Figure {
  /** @type {Place | null} where the grid's strong lines meet */
  #origin = null;
  /** @type {Place | null} */
  #anchor = null;
  #drawn = -1;

  /** @param {HTMLElement} under holds the grid, below tiles and picture @param {HTMLElement} over holds the figure */
  constructor(under, over) {
    const path = (/** @type {string} */ name) => svg('path', { class: name });
    this.weak = path('g');
    this.strong = path('g5');
    this.grid = svg('svg', { class: 'mapv', 'aria-hidden': 'true' }, this.weak, this.strong);
    this.driven = path('tr');
    this.unseen = path('unseen');
    this.dots = path('dots');
    this.lines = svg('g', {}, this.unseen, this.driven, this.dots);
    this.tail = path('tr tail');
    this.around = svg('circle', { class: 'phacc' });
    this.ellipse = svg('ellipse', { class: 'acc' });
    this.way = path('dl');
    this.nose = svg('path', { class: 'nose', d: 'M0 -24L15 18 0 9 -15 18Z' });
    this.dart = svg('path', { class: 'car', d: 'M0 -24L15 18 0 9 -15 18Z' });
    this.body = svg('path', { class: 'car', d: 'M0 -13L13 0 0 13 -13 0Z' });
    this.carMark = svg('g', { class: 'car-mark' }, this.nose, this.dart, this.body);
    this.phoneMark = svg('g', { class: 'phone-mark' }, svg('circle', { class: 'ph', r: 12 }), svg('circle', { class: 'phd', r: 4.5 }));
    this.carName = svg('text', { class: 'name' });
    this.phoneName = svg('text', { class: 'name' });
    this.apart = svg('text', { class: 'beside' });
    this.scaleGround = path('scg');
    this.bar = path('sc');
    this.barText = svg('text');
    this.others = new OtherPhones();
    this.picture = svg('svg', { class: 'mapv', role: 'img' }, this.lines, this.tail, this.scaleGround, this.others.root, this.around, this.ellipse, this.way, this.carMark, this.phoneMark,
      this.carName, this.phoneName, this.apart, this.bar, this.barText);
    under.append(this.grid);
    over.append(this.picture);
  }

  /** @param {string} text for a screen reader */
  describe(text) {
    setAttribute(this.picture, 'aria-label', text);
  }

  /** @param {Shown} shown */
  draw({ view, size, car, phone, apart, track, others = [] }) {
    this.#drawGrid(view, size);
    this.#drawTrack(view, size, track);
    const [carAt, phoneAt] = [car, phone].map(({ place }) => (place ? pixelOf(place, view, size) : null));
    this.#drawTail(view, size, car, track, carAt ?? null);
    this.others.draw(others, view, size);
    this.#drawCar(view, car, carAt ?? null);
    this.#drawPhone(view, phone, phoneAt ?? null);
    this.#taken = [...(size.taken ?? []), this.#drawScale(view, size)];
    for (const at of [carAt, phoneAt]) if (at) this.#taken.push(around(at, MARK_PX, MARK_PX));
    this.#drawNames(view, size, car, phone, carAt ?? null, phoneAt ?? null);
    this.#drawWay(size, apart, carAt ?? null, phoneAt ?? null);
  }

  /** @param {View} view @param {Size} size */
  #drawGrid(view, size) {
    if (!this.#origin || Math.hypot(...Object.values(offsetOf(this.#origin, view.centre))) > 20_000) this.#origin = view.centre;
    const { weak, strong } = gridPaths(offsetOf(this.#origin, view.centre), view, size);
    setAttribute(this.weak, 'd', weak);
    setAttribute(this.strong, 'd', strong);
  }

  /** @param {View} view @param {Size} size @param {import('./map-track.js').Track} track */
  #drawTrack(view, size, track) {
    const reach_m = Math.min(ANCHOR_M, 0.01 * 6.37e6 * Math.cos((view.centre.lat_deg * Math.PI) / 180));
    let middle = this.#anchor ? offsetOf(this.#anchor, view.centre) : null;
    if (!middle || Math.hypot(middle.east_m, middle.north_m) > reach_m) {
      this.#anchor = view.centre;
      middle = { east_m: 0, north_m: 0 };
      this.#drawn = -1;
    }
    if (this.#drawn !== track.version && this.#anchor) {
      this.#drawn = track.version;
      const { driven, unseen, dots } = trackPaths(track.points, this.#anchor);
      setAttribute(this.driven, 'd', driven);
      setAttribute(this.unseen, 'd', unseen);
      setAttribute(this.dots, 'd', dots);
    }
    setAttribute(this.lines, 'transform', `matrix(${groundMatrix(middle, view, size).map((one) => one.toPrecision(9)).join(' ')})`);
  }

  /** @param {View} view @param {Size} size @param {import('./map-text.js').CarShown} car @param {import('./map-track.js').Track} track @param {Pixel | null} carAt */
  #drawTail(view, size, car, track, carAt) {
    const last = track.points.at(-1);
    let d = '';
    if (last && car.place && carAt && car.isLive) {
      const { east_m, north_m } = offsetOf(last, car.place);
      if (Math.hypot(east_m, north_m) < TAIL_M) d = `M${pixelOf(last, view, size).map(round).join(' ')}L${carAt.map(round).join(' ')}`;
    }
    setAttribute(this.tail, 'd', d);
  }

  /** @param {View} view @param {import('./map-text.js').CarShown} car @param {Pixel | null} at */
  #drawCar(view, car, at) {
    shown(this.carMark, at !== null);
    shown(this.ellipse, at !== null && car.isLive && car.ellipse !== null);
    if (!at) return;
    setAttribute(this.carMark, 'data-ink', car.isLive ? car.ink : 'stale');
    setAttribute(this.carMark, 'transform', `translate(${round(at[0])} ${round(at[1])})`);
    const turn = car.heading_deg === null ? '' : `rotate(${round(turned(car.heading_deg - view.up_deg))})`;
    shown(this.dart, car.heading_deg !== null && car.isHeadingLive);
    shown(this.nose, car.heading_deg !== null && !car.isHeadingLive); // where it looked once: only as an outline
    shown(this.body, car.heading_deg === null || (car.isLive && !car.isHeadingLive)); // no shape that points anywhere
    setAttribute(this.dart, 'transform', turn);
    setAttribute(this.nose, 'transform', turn);
    if (!car.ellipse) return;
    const { major_m, minor_m, bearing_deg } = car.ellipse;
    setAttribute(this.ellipse, 'rx', round(minor_m / view.mpp));
    setAttribute(this.ellipse, 'ry', round(major_m / view.mpp));
    setAttribute(this.ellipse, 'transform', `translate(${round(at[0])} ${round(at[1])}) rotate(${round(bearing_deg - view.up_deg)})`);
  }

  /** @param {View} view @param {import('./map-text.js').PhoneOnMap} phone @param {Pixel | null} at */
  #drawPhone(view, phone, at) {
    shown(this.phoneMark, at !== null);
    shown(this.around, at !== null && phone.isLive && phone.accuracy_m !== null);
    if (!at) return;
    setAttribute(this.phoneMark, 'data-ink', phone.isLive ? 'fresh' : 'stale');
    setAttribute(this.phoneMark, 'transform', `translate(${round(at[0])} ${round(at[1])})`);
    setAttribute(this.around, 'cx', round(at[0]));
    setAttribute(this.around, 'cy', round(at[1]));
    setAttribute(this.around, 'r', round((phone.accuracy_m ?? 0) / view.mpp));
  }

  /** @param {Size} size @param {import('./map-text.js').Apart | null} apart @param {Pixel | null} carAt @param {Pixel | null} phoneAt */
  #drawWay(size, apart, carAt, phoneAt) {
    const isShown = apart !== null && carAt !== null && phoneAt !== null;
    shown(this.way, isShown);
    const ends = isShown ? inside(phoneAt, carAt, size) : null;
    const length = ends ? Math.hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]) : 0;
    shown(this.apart, ends !== null && length > ROOM_PX);
    if (!apart || !carAt || !phoneAt) return;
    setAttribute(this.way, 'd', `M${phoneAt.map(round).join(' ')}L${carAt.map(round).join(' ')}`);
    if (!ends) return;
    const [number, unit] = distanceWords(apart.distance_m);
    write(this.apart, `${number} ${unit}`, bearingWords(apart.bearing_deg));
    const [x, y] = besideWay(ends, size);
    const box = around([x, y], HALF.x, HALF.y);
    const top = clearTop(box, this.#taken, size.height);
    if (top === null && size.height < HIDING_PX) shown(this.apart, false);
    place(this.apart, x, (top ?? box.top) + HALF.y - 2); // two lines: the first stands above the middle
  }

  /** @param {View} view @param {Size} size @param {import('./map-text.js').CarShown} car @param {import('./map-text.js').PhoneOnMap} phone @param {Pixel | null} carAt @param {Pixel | null} phoneAt */
  #drawNames(view, size, car, phone, carAt, phoneAt) {
    const isCarAbove = !carAt || !phoneAt || phoneAt[1] >= carAt[1]; // the names stand away from each other
    const carRoom = Math.max(28, car.isLive && car.ellipse ? reachUp(car.ellipse, view) : 0);
    const phoneRoom = nameRoom(phone.isLive ? (phone.accuracy_m ?? 0) / view.mpp : 0);
    this.#drawName(this.carName, size, carAt, car.label, isCarAbove, carRoom);
    this.#drawName(this.phoneName, size, phoneAt, phone.label, !isCarAbove, phoneRoom);
  }

  /** Where the bar of the scale ends. */
  #scaleEnd_px = 0;
  /** By keys, by a head, by labels drawn already. @type {import('./map-layout.js').Box[]} */
  #taken = [];

  /** @param {SVGElement} text @param {Size} size @param {Pixel | null} at @param {string} name @param {boolean} isAbove @param {number} room */
  #drawName(text, size, at, name, isAbove, room) {
    const isShown = at !== null && at[0] > -20 && at[0] < size.width + 20 && at[1] > -20 && at[1] < size.height + 20;
    shown(text, isShown);
    if (!at) return;
    const lines = linesOf(name, (size.width - KEYS_PX - 16) / LETTER_PX);
    writeLines(text, lines);
    const half = (Math.max(...lines.map((line) => line.length)) * LETTER_PX) / 2 + 8;
    const more = (lines.length - 1) * LINE_PX;
    const y = isAbove ? at[1] - room - 10 - more : at[1] + room + 20;
    const x = Math.min(size.width - KEYS_PX - half, Math.max(half, at[0]));
    const isBesideScale = x - half > this.#scaleEnd_px + 8;
    const box = { left: x - half, top: Math.min(size.height - (isBesideScale ? 8 : 44) - more, Math.max(20, y)) - NAME_PX.up, width: 2 * half, height: NAME_PX.high + more };
    const sides = [at[0] + MARK_PX, at[0] - MARK_PX - box.width].map((left) => ({ ...box, left, top: at[1] - box.height / 2 }));
    const clear = clearBox(box, sides, this.#taken, size);
    if (!clear && size.height < HIDING_PX) shown(text, false);
    else if (clear && isShown) this.#taken.push(clear);
    const { left, top } = clear ?? clearBox(box, [], size.taken ?? [], size) ?? box; // over another name, not under a key
    place(text, left + half, top + NAME_PX.up);
  }

  /** Gives the room that it takes. @param {View} view @param {Size} size @returns {import('./map-layout.js').Box} */
  #drawScale(view, size) {
    const y = size.height - 26;
    const left = scaleLeft(size);
    const band = { left, top: y - 20, width: size.width, height: 32 };
    const end = Math.min(size.width, ...(size.taken ?? []).filter((one) => one.left > left && overlap(one, band)).map((one) => one.left - 10));
    const length_m = scaleBar_m(view.mpp, end - left);
    const [number, unit] = length_m >= 1000 ? [String(length_m / 1000), 'km'] : [String(length_m), 'm'];
    this.#scaleEnd_px = left + length_m / view.mpp;
    setAttribute(this.bar, 'd', `M${left} ${y}v8h${round(length_m / view.mpp)}v-8`);
    const wide = Math.max(68, round(length_m / view.mpp) + 12); // at least as its text
    setAttribute(this.scaleGround, 'd', `M${left - 6} ${y - 28}h${wide}v44h${-wide}z`);
    write(this.barText, `${number} ${unit}`);
    place(this.barText, left + 2, y - 5);
    return { ...band, width: this.#scaleEnd_px - left };
  }
}

/** A box around a point. @param {Pixel} at @param {number} x_px half its width @param {number} y_px half its height */
function around([x, y], x_px, y_px) {
  return { left: x - x_px, top: y - y_px, width: 2 * x_px, height: 2 * y_px };
}

/** From a phone to its name: outside the circle of its accuracy, unless that is wide [px]. @param {number} around_px */
export const nameRoom = (around_px) => (around_px > WIDE_PX ? 18 : Math.max(18, around_px));

/** On a low map the compass stands above the bar. @param {Size} size */
const scaleLeft = (size) => (size.height < LOW_PX ? 72 : 16);

/** How far an ellipse reaches up on the map [px]. @param {import('./map-layout.js').Ellipse} ellipse @param {View} view */
function reachUp({ major_m, minor_m, bearing_deg }, view) {
  const turn = ((bearing_deg - view.up_deg) * Math.PI) / 180;
  return Math.hypot(major_m * Math.cos(turn), minor_m * Math.sin(turn)) / view.mpp;
}

/**
 * The part of a way that is on the map, or null.
 * @param {Pixel} a
 * @param {Pixel} b
 * @param {Size} size
 * @returns {[Pixel, Pixel] | null}
 */
export function inside(a, b, { width, height }) {
  let [from, to] = [0, 1];
  const way = /** @type {Pixel} */ ([b[0] - a[0], b[1] - a[1]]);
  for (const [at, step, end] of /** @type {[number, number, number][]} */ ([[a[0], way[0], width], [a[1], way[1], height]])) {
    if (step === 0) {
      if (at < 0 || at > end) return null;
      continue;
    }
    const [first = 0, last = 1] = [-at / step, (end - at) / step].sort((one, other) => one - other);
    from = Math.max(from, first);
    to = Math.min(to, last);
  }
  if (from >= to) return null;
  return [[a[0] + way[0] * from, a[1] + way[1] * from], [a[0] + way[0] * to, a[1] + way[1] * to]];
}

/** Half of the room that distance and bearing take [px]. */
const HALF = { x: 36, y: 20 };

/**
 * The middle of the number beside a way: clear of it, on its left side where that is on the map.
 * @param {[Pixel, Pixel]} ends
 * @param {Size} size
 * @returns {Pixel}
 */
export function besideWay([a, b], { width, height }) {
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  let [nx, ny] = [-(b[1] - a[1]) / length, (b[0] - a[0]) / length];
  if (nx > 0.05 || (Math.abs(nx) <= 0.05 && ny < 0)) [nx, ny] = [-nx, -ny]; // to the left; of a level way, beneath
  const off = 14 + Math.abs(nx) * HALF.x + Math.abs(ny) * HALF.y;
  const [x, y] = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
  const fits = x + nx * off > HALF.x && y + ny * off > HALF.y && y + ny * off < height - HALF.y - 40;
  const side = fits ? off : -off;
  return [Math.min(width - HALF.x, Math.max(HALF.x, x + nx * side)), Math.min(height - HALF.y - 40, Math.max(HALF.y, y + ny * side))];
}

/** A name in lines. @param {SVGElement} text @param {string[]} lines */
function writeLines(text, lines) {
  const name = lines.join(' ');
  if (text.textContent === name && Math.max(1, text.childElementCount) === lines.length) return;
  text.replaceChildren(...(lines.length === 1 ? [name] : lines.map((line, n) => svg('tspan', { x: 0, dy: n ? LINE_PX : 0 }, n ? ` ${line}` : line))));
}

/** @param {Element} element @param {boolean} isShown */
function shown(element, isShown) {
  setAttribute(element, 'display', isShown ? null : 'none');
}

/** @param {SVGElement} text @param {number} x @param {number} y */
function place(text, x, y) {
  setAttribute(text, 'transform', `translate(${round(x)} ${round(y)})`);
}

/**
 * A number with its unit in the face of numbers, and what belongs to it in the line beneath.
 * @param {SVGElement} text
 * @param {string} number
 * @param {string} [beneath]
 */
function write(text, number, beneath = '') {
  const key = `${number}|${beneath}`;
  if (text.getAttribute('data-words') === key) return;
  text.setAttribute('data-words', key);
  text.replaceChildren(svg('tspan', { class: 'num' }, number), ...(beneath ? [svg('tspan', { class: 'beneath', x: 0, dy: 18 }, beneath)] : []));
}
