// What the map shows and where: pure functions. A view is the place in its middle, its scale, and which way is up.

import { mercatorScale, offsetOf, placeAt, turnTo, turned } from '../core/geodesy.js';

/**
 * @typedef {import('../core/geodesy.js').Place} Place
 * @typedef {import('../core/geodesy.js').Offset} Offset
 * @typedef {{centre: Place, mpp: number, up_deg: number}} View mpp: metres a CSS pixel; up_deg: the bearing that points up
 * @typedef {{width: number, height: number, taken?: Box[]}} Size of the map in CSS pixels; taken: by keys and heads that lie over it
 * @typedef {{left: number, top: number, width: number, height: number}} Box [px]
 * @typedef {[number, number]} Pixel from the top left corner
 * @typedef {{major_m: number, minor_m: number, bearing_deg: number}} Ellipse semi-axes, and where the major one points
 */

const RAD = Math.PI / 180;
/** The closest and the widest view [m/px]: a car of 5 m across a phone, and 40 km. */
export const CLOSEST = 0.0125;
export const WIDEST = 100;
/** The view of a first look: 10 m are 74 px. */
export const FIRST = 0.135;

/** @param {number} mpp */
export function bounded(mpp) {
  return Number.isFinite(mpp) ? Math.min(WIDEST, Math.max(CLOSEST, mpp)) : FIRST;
}

/**
 * Metres east and north of the middle as pixels from the middle.
 * @param {Offset} offset
 * @param {Pick<View, 'mpp' | 'up_deg'>} view
 * @returns {Pixel}
 */
export function turnedPixels({ east_m, north_m }, { mpp, up_deg }) {
  const [sin, cos] = [Math.sin(up_deg * RAD), Math.cos(up_deg * RAD)];
  return [(east_m * cos - north_m * sin) / mpp, -(east_m * sin + north_m * cos) / mpp];
}

/**
 * Where a place stands on the map.
 * @param {Place} place
 * @param {View} view
 * @param {Size} size
 * @returns {Pixel}
 */
export function pixelOf(place, view, { width, height }) {
  const [x, y] = turnedPixels(offsetOf(view.centre, place), view);
  return [width / 2 + x, height / 2 + y];
}

/**
 * What lies some pixels right of and below the middle, in metres east and north of it.
 * @param {number} dx
 * @param {number} dy
 * @param {Pick<View, 'mpp' | 'up_deg'>} view
 * @returns {Offset}
 */
export function metresOf(dx, dy, { mpp, up_deg }) {
  const [sin, cos] = [Math.sin(up_deg * RAD), Math.cos(up_deg * RAD)];
  return { east_m: (dx * cos - dy * sin) * mpp, north_m: (-dx * sin - dy * cos) * mpp };
}

/**
 * The map pulled by the hand: what lay under the finger stays under it.
 * @param {View} view
 * @param {number} dx
 * @param {number} dy
 * @returns {View}
 */
export function panned(view, dx, dy) {
  const { east_m, north_m } = metresOf(dx, dy, view);
  return { ...view, centre: placeAt(view.centre, { east_m: -east_m, north_m: -north_m }) };
}

/**
 * The map made larger by `factor`; what lies `dx`, `dy` pixels from the middle stays where it is.
 * @param {View} view
 * @param {number} factor
 * @param {number} [dx]
 * @param {number} [dy]
 * @returns {View}
 */
export function zoomed(view, factor, dx = 0, dy = 0) {
  const mpp = bounded(view.mpp / factor);
  if (!dx && !dy) return { ...view, mpp };
  const { east_m, north_m } = metresOf(dx, dy, { mpp: view.mpp - mpp, up_deg: view.up_deg });
  return { ...view, mpp, centre: placeAt(view.centre, { east_m, north_m }) };
}

/** The steps of grid and scale: 1, 2, 5, 10, … metres. */
const STEPS_M = [-2, -1, 0, 1, 2, 3, 4, 5, 6].flatMap((power) => [1, 2, 5].map((digit) => digit * 10 ** power));
/** Two lines of the grid stand at least so far apart [px]; every fifth is a strong one. */
const LINES_PX = 40;
const SCALE_PX = 150;

/** Metres between two lines of the grid: 10 at the first look, and 50 between two strong ones. @param {number} mpp */
export function gridStep_m(mpp) {
  return STEPS_M.find((step) => step / mpp >= LINES_PX) ?? 5e6;
}

/** The length of the scale's bar: at most 150 px of it. @param {number} mpp @param {number} [room_px] there is for it */
export function scaleBar_m(mpp, room_px = SCALE_PX) {
  return STEPS_M.findLast((step) => step / mpp <= Math.min(SCALE_PX, room_px)) ?? 0.01;
}

/** @param {Box} a @param {Box} b */
export function overlap(a, b) {
  return a.left < b.left + b.width && b.left < a.left + a.width && a.top < b.top + b.height && b.top < a.top + a.height;
}

/**
 * The place of a label: its own, or the nearest above or below it that is clear of what is taken.
 * @param {Box} box of the label
 * @param {Box[]} taken
 * @param {number} height of the map [px]
 * @returns {number | null} top of the label; null: nowhere
 */
export function clearTop(box, taken, height) {
  const beside = taken.flatMap(({ top, height: high }) => [top - box.height - 1, top + high + 1]);
  const fits = [box.top, ...beside].filter((top) => top >= 0 && top + box.height <= height && !taken.some((one) => overlap({ ...box, top }, one)));
  return fits.sort((a, b) => Math.abs(a - box.top) - Math.abs(b - box.top))[0] ?? null;
}

/**
 * Where a name stands: in its place or a line or two above or below it, else beside its mark, else in its column as near as it is clear.
 * @param {Box} box of the name
 * @param {Box[]} sides beside its mark
 * @param {Box[]} taken
 * @param {Size} size
 * @returns {Box | null} null: nowhere
 */
export function clearBox(box, sides, taken, { width, height }) {
  const top = clearTop(box, taken, height);
  if (top !== null && Math.abs(top - box.top) <= 2 * box.height) return { ...box, top };
  const beside = sides.find((one) => one.left >= 0 && one.left + one.width <= width && clearTop(one, taken, height) === one.top);
  return beside ?? (top === null ? null : { ...box, top });
}

/**
 * A name in as few lines of at most so many letters as its words allow, which are about equally long.
 * @param {string} name
 * @param {number} letters
 */
export function linesOf(name, letters) {
  let lines = filled(name, letters);
  for (let fewer = letters - 1; fewer > 0; fewer -= 1) {
    const narrower = filled(name, fewer);
    if (narrower.length > lines.length) break;
    lines = narrower;
  }
  return lines;
}

/** @param {string} name @param {number} letters in a line, or more for a longer word */
function filled(name, letters) {
  /** @type {string[]} */
  const lines = [];
  for (const word of name.split(' ')) {
    const last = lines.at(-1);
    if (last !== undefined && last.length + 1 + word.length <= letters) lines[lines.length - 1] = `${last} ${word}`;
    else lines.push(word);
  }
  return lines;
}

/**
 * The grid's lines over the map, as an SVG path of the weak and one of the strong: they lie still on the ground.
 * @param {Offset} middle where the view's middle is from the grid's origin
 * @param {Pick<View, 'mpp' | 'up_deg'>} view
 * @param {Size} size
 */
export function gridPaths(middle, view, { width, height }) {
  const step = gridStep_m(view.mpp);
  const reach_m = (Math.hypot(width, height) / 2) * view.mpp;
  const paths = { weak: '', strong: '' };
  for (const axis of /** @type {const} */ (['east_m', 'north_m'])) {
    const first = Math.ceil((middle[axis] - reach_m) / step);
    const last = Math.floor((middle[axis] + reach_m) / step);
    for (let line = first; line <= last; line += 1) {
      const at = line * step - middle[axis];
      const other = axis === 'east_m' ? 'north_m' : 'east_m';
      const ends = [-reach_m, reach_m].map((along) => turnedPixels(/** @type {Offset} */ ({ [axis]: at, [other]: along }), view));
      const [a, b] = ends.map(([x, y]) => `${round(width / 2 + x)} ${round(height / 2 + y)}`);
      paths[line % 5 === 0 ? 'strong' : 'weak'] += `M${a}L${b}`;
    }
  }
  return paths;
}

/**
 * From metres east and north of an anchor to pixels, as an SVG matrix; `middle` is where the view's middle is from it.
 * @param {Offset} middle
 * @param {Pick<View, 'mpp' | 'up_deg'>} view
 * @param {Size} size
 * @returns {[number, number, number, number, number, number]}
 */
export function groundMatrix(middle, view, { width, height }) {
  const [sin, cos] = [Math.sin(view.up_deg * RAD) / view.mpp, Math.cos(view.up_deg * RAD) / view.mpp];
  const { east_m, north_m } = middle;
  return [cos, -sin, -sin, -cos, width / 2 - (cos * east_m - sin * north_m), height / 2 + (sin * east_m + cos * north_m)];
}

/**
 * The ellipse in which a fix lies with one sigma, from the variances of its axes and what they share [m²].
 * Eigenvalues of a symmetric 2×2 matrix.
 * @param {[number, number, number] | null | undefined} covariance_m2 east, north, east-north
 * @param {number | null | undefined} sigma_m all around, where nothing more is known
 * @returns {Ellipse | null} null: quality unknown
 */
export function ellipseOf(covariance_m2, sigma_m) {
  if (Array.isArray(covariance_m2) && covariance_m2.every(Number.isFinite)) {
    const [east, north, both] = covariance_m2;
    const mean = (east + north) / 2;
    const off = Math.hypot((east - north) / 2, both);
    if (mean - off > 0) {
      return { major_m: Math.sqrt(mean + off), minor_m: Math.sqrt(mean - off), bearing_deg: off === 0 ? 0 : turned(Math.atan2(2 * both, north - east) / 2 / RAD) % 180 };
    }
  }
  return typeof sigma_m === 'number' && sigma_m > 0 && Number.isFinite(sigma_m) ? { major_m: sigma_m, minor_m: sigma_m, bearing_deg: 0 } : null;
}

/** Room that is left around what is to be seen at once [px]: keys at the right, north at the left, names above and below. */
const MARGIN = { x: 84, y: 76 };
/** So much wider than needed, lest it be changed at every step; and changed when it is so much wider than needed. */
const ROOM = 1.25;
const TOO_WIDE = 3;

/**
 * The view in which two places are to be seen, with what they are uncertain by. Its scale stays while it is good enough.
 * @param {View} view
 * @param {Size} size
 * @param {Place} a
 * @param {Place} b
 * @param {number} around_m around each
 * @returns {View & {fits: boolean}} fits: false where they are too far apart for any view: then `a` is in the middle
 */
export function fitted(view, size, a, b, around_m = 0) {
  const way = offsetOf(a, b);
  const [x, y] = turnedPixels(way, { mpp: 1, up_deg: view.up_deg });
  const room = { x: Math.max(80, size.width - 2 * MARGIN.x), y: Math.max(80, size.height - 2 * MARGIN.y) };
  const needed = Math.max((Math.abs(x) + 2 * around_m) / room.x, (Math.abs(y) + 2 * around_m) / room.y, CLOSEST);
  if (needed > WIDEST) return { ...view, centre: a, fits: false };
  const isGood = view.mpp >= needed && view.mpp <= needed * TOO_WIDE;
  const mpp = isGood ? view.mpp : bounded(Math.max(needed * ROOM, FIRST / 4));
  return { ...view, mpp, centre: placeAt(a, { east_m: way.east_m / 2, north_m: way.north_m / 2 }), fits: true };
}

/** A heading trembles; the map turns only when it is off by more than this [°]. */
const STEADY_DEG = 3;

/**
 * Which bearing is up now. Without a heading to trust the map stays as it was: turning it north would be a movement that
 * nobody made.
 * @param {number} up_deg as it is
 * @param {boolean} isHeadingUp as the operator wants it
 * @param {number | null} heading_deg of the car where it is known and fresh
 */
export function upOf(up_deg, isHeadingUp, heading_deg) {
  if (!isHeadingUp) return 0;
  if (heading_deg === null || !Number.isFinite(heading_deg)) return up_deg;
  return Math.abs(turnTo(up_deg, heading_deg)) > STEADY_DEG ? turned(heading_deg) : up_deg;
}

/**
 * Between two views, for a movement that can be followed by the eye.
 * @param {View} from
 * @param {View} to
 * @param {number} share 0 … 1
 * @returns {View}
 */
export function between(from, to, share) {
  if (share >= 1) return to;
  return {
    centre: placeBetween(from.centre, to.centre, share),
    mpp: from.mpp * (to.mpp / from.mpp) ** share,
    up_deg: turned(from.up_deg + turnTo(from.up_deg, to.up_deg) * share),
  };
}

/** @param {Place} from @param {Place} to @param {number} share @returns {Place} */
export function placeBetween(from, to, share) {
  const { east_m, north_m } = offsetOf(from, to);
  return share >= 1 ? to : placeAt(from, { east_m: east_m * share, north_m: north_m * share });
}

const EQUATOR_M = 2 * Math.PI * 6_378_137; // the sphere of EPSG:3857
/** There the tiles of the world end. */
export const MERCATOR_END_DEG = 85.0511;
/** Pixels of a tile. */
const TILE = 256;

/**
 * Whole zoom level at which tiles come nearest to a scale, and how they must be stretched to have it: neither is a metre
 * of Mercator a metre on the ground, nor the same to the east and to the north.
 * @param {View} view
 */
export function tileScale({ centre, mpp }) {
  const metre = mercatorScale(centre.lat_deg);
  const level = Math.log2((EQUATOR_M * metre.east) / TILE / mpp);
  const zoom = Math.min(24, Math.max(0, Math.round(level)));
  const pixel_m = EQUATOR_M / TILE / 2 ** zoom;
  return { zoom, x: (pixel_m * metre.east) / mpp, y: (pixel_m * metre.north) / mpp };
}

/**
 * The CSS matrix that lays a picture on the ground by three of its corners.
 * @param {Place[]} corners top left, top right, bottom left
 * @param {Size} picture its own pixels
 * @param {View} view
 * @param {Size} size
 */
export function pictureMatrix(corners, picture, view, size) {
  const [o, r, d] = corners.map((corner) => pixelOf(corner, view, size));
  if (!o || !r || !d) return [1, 0, 0, 1, 0, 0];
  return [(r[0] - o[0]) / picture.width, (r[1] - o[1]) / picture.width, (d[0] - o[0]) / picture.height, (d[1] - o[1]) / picture.height, ...o];
}

/** One digit behind the point is a tenth of a pixel. @param {number} value */
export function round(value) {
  return Math.round(value * 10) / 10;
}
