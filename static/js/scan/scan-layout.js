// What the plot of a scan shows and where: pure functions. x is ahead and y left of the car's nose, in metres.

import { INVALID, NO_RETURN, NOTHING_IN_RANGE, TOO_CLOSE, bearingOf, rangeOf } from './scan-frame.js';
import { bearing } from '../core/format.js';

/** A hatched sector narrower than this is not named: the label would not fit [rad]. */
const NAMED_RAD = (6 * Math.PI) / 180;
/** The plot reaches no nearer and no farther than this [m]. */
export const REACH_M = { least: 4, most: 120, first: 20 };
/** One press of + or −. */
const ZOOM_STEP = Math.SQRT2;
/** Half of the height of a number's plate [px]. */
const HALF_NUMBER_PX = 10;
/** Farther behind the nose than this a return is below the plot [m]. */
const BEHIND_M = 0.5;
/** Above this many beams, a return whose square of 5 px would cover its neighbour's but for this is not drawn again [px]. */
const THINNED = { beams: 1000, px: 1.5 };

/** @typedef {import('./scan-frame.js').Scan} Scan */

/**
 * The points to draw: x, y of each usable beam, one after the other [m]. What has no range is not drawn: neither what is
 * too close nor what is beyond.
 * @param {Scan} scan
 * @param {number} reach_m nothing farther is drawn
 * @param {number} [pixel_m] what a pixel of the plot is
 * @returns {Float32Array}
 */
export function pointsOf(scan, reach_m, pixel_m = 0) {
  const points = new Float32Array(2 * scan.codes.length);
  const { codes, scale_m, angle_min_rad, angle_increment_rad, x_m = 0, y_m = 0 } = scan;
  const apart_m = codes.length > THINNED.beams ? THINNED.px * pixel_m : -1;
  let used = 0;
  let [px, py] = [Infinity, Infinity];
  for (let i = 0; i < codes.length; i += 1) {
    const code = codes[i] ?? NO_RETURN;
    if (code === NO_RETURN || code >= INVALID || code * scale_m > reach_m) continue;
    const angle = angle_min_rad + i * angle_increment_rad;
    const x = code * scale_m * Math.cos(angle) + x_m;
    const y = code * scale_m * Math.sin(angle) + y_m;
    if (Math.abs(x - px) <= apart_m && Math.abs(y - py) <= apart_m) continue;
    points[used] = px = x;
    points[used + 1] = py = y;
    used += 2;
  }
  return points.subarray(0, used);
}

/**
 * How many usable returns lie behind the nose, where the plot does not reach.
 * @param {Scan} scan
 */
export function behind(scan) {
  let count = 0;
  for (let i = 0; i < scan.codes.length; i += 1) {
    const range_m = rangeOf(scan, i);
    if (range_m !== null && range_m * Math.cos(bearingOf(scan, i)) + (scan.x_m ?? 0) < -BEHIND_M) count += 1;
  }
  return count;
}

/**
 * @typedef {{from_rad: number, to_rad: number, code: number, beams: number}} Sector from < to, half a beam wider on each side
 */

/** In the place of a code: no beam looks there at all. */
export const NOT_IN_VIEW = -1;

/**
 * What lies ahead and is looked at by no beam: a sector on either side of a laser that sees less than half a turn.
 * @param {Scan} scan
 * @returns {Sector[]}
 */
export function unseenOf(scan) {
  const { codes, angle_min_rad, angle_increment_rad } = scan;
  const quarter = Math.PI / 2;
  const unseen = (/** @type {number} */ from_rad, /** @type {number} */ to_rad) => ({ from_rad, to_rad, code: NOT_IN_VIEW, beams: 0 });
  if (codes.length === 0) return [unseen(-quarter, quarter)];
  const half = Math.abs(angle_increment_rad) / 2;
  const last_rad = angle_min_rad + (codes.length - 1) * angle_increment_rad;
  const low = Math.min(angle_min_rad, last_rad) - half;
  const high = Math.max(angle_min_rad, last_rad) + half;
  // The laser may count its angles from anywhere: its view is laid over the half turn ahead once for each whole turn.
  const seen = [-1, 0, 1, 2].map((turn) => [low - 2 * Math.PI * turn, high - 2 * Math.PI * turn]).sort(([a = 0], [b = 0]) => a - b);
  const found = [];
  let from = -quarter;
  for (const [begin = 0, end = 0] of seen) {
    if (begin > from + half && from < quarter) found.push(unseen(from, Math.min(begin, quarter)));
    from = Math.max(from, end);
  }
  if (from < quarter - half) found.push(unseen(from, quarter));
  return found.filter(({ from_rad, to_rad }) => to_rad > from_rad);
}

/**
 * Neighbouring beams without a usable range, grouped by their code. Nothing in range is a reading of the sensor and is not hatched.
 * @param {Scan} scan
 * @returns {Sector[]}
 */
export function sectorsOf(scan) {
  /** @type {Sector[]} */
  const sectors = [];
  const half = Math.abs(scan.angle_increment_rad) / 2;
  /** @type {{code: number, from: number} | null} */
  let open = null;
  const close = (/** @type {number} */ end) => {
    if (!open) return;
    const a = scan.angle_min_rad + open.from * scan.angle_increment_rad;
    const b = scan.angle_min_rad + (end - 1) * scan.angle_increment_rad;
    sectors.push({ from_rad: Math.min(a, b) - half, to_rad: Math.max(a, b) + half, code: open.code, beams: end - open.from });
    open = null;
  };
  for (let i = 0; i < scan.codes.length; i += 1) {
    const code = scan.codes[i] ?? NO_RETURN;
    const isBlind = code === NO_RETURN || code === TOO_CLOSE || code === INVALID;
    if (open && (!isBlind || code !== /** @type {{code: number}} */ (open).code)) close(i);
    if (isBlind && !open) open = { code, from: i };
  }
  close(scan.codes.length);
  return joined(scan, sectors).map(beforeTheCar);
}

/** A full circle has no seam: what ends at the last beam goes on at the first. @param {Scan} scan @param {Sector[]} sectors */
function joined({ codes, angle_increment_rad }, sectors) {
  const [first, last] = [sectors[0], sectors.at(-1)];
  const step = Math.abs(angle_increment_rad);
  const isRound = Math.abs(2 * Math.PI - codes.length * step) <= 1.01 * step;
  const touch = first && last && first !== last && first.code === last.code && codes[0] === first.code && codes[codes.length - 1] === last.code;
  if (!isRound || !touch) return sectors;
  const width = first.to_rad - first.from_rad + last.to_rad - last.from_rad;
  const { from_rad } = angle_increment_rad > 0 ? last : first;
  return [...sectors.slice(1, -1), { from_rad, to_rad: from_rad + width, code: first.code, beams: first.beams + last.beams }];
}

/** The same sector, its middle within half a turn of ahead. @param {Sector} sector @returns {Sector} */
function beforeTheCar(sector) {
  const turned = 2 * Math.PI * Math.round((sector.from_rad + sector.to_rad) / (4 * Math.PI));
  return turned ? { ...sector, from_rad: sector.from_rad - turned, to_rad: sector.to_rad - turned } : sector;
}

/** @param {number} code */
export function codeWords(code) {
  if (code === NOT_IN_VIEW) return 'not in view';
  if (code === TOO_CLOSE) return 'too close';
  if (code === INVALID) return 'invalid';
  if (code === NOTHING_IN_RANGE) return 'nothing in range';
  return 'no return';
}

/**
 * The sectors wide enough for a label, widest first, at most `count`.
 * @param {Sector[]} sectors
 * @param {number} count
 */
export function namedSectors(sectors, count) {
  return sectors.filter(({ from_rad, to_rad }) => to_rad - from_rad >= NAMED_RAD)
    .sort((a, b) => b.to_rad - b.from_rad - (a.to_rad - a.from_rad)).slice(0, count);
}

/**
 * The text of these sectors for a screen reader: "no return from 55° right to 72° right".
 * @param {Sector[]} sectors
 * @param {number} count
 */
export function sectorSentences(sectors, count) {
  const side = (/** @type {number} */ angle) => {
    const where = bearing(angle);
    return where ? (where.side === 'ahead' ? 'straight ahead' : `${where.degrees} ${where.side}`) : '';
  };
  return namedSectors(sectors, count).map(({ code, from_rad, to_rad }) => `${codeWords(code)} from ${side(to_rad)} to ${side(from_rad)}`);
}

/**
 * "164 of 181 beams usable · 17 hatched: no return".
 * @param {Scan} scan
 */
export function beamWords(scan) {
  const counts = new Map();
  for (const code of scan.codes) {
    const kind = code === NO_RETURN || code >= INVALID ? code : -1;
    counts.set(kind, (counts.get(kind) ?? 0) + 1);
  }
  const usable = counts.get(-1) ?? 0;
  const beyond = counts.get(NOTHING_IN_RANGE);
  const parts = beyond ? [`${usable} of ${scan.codes.length} usable`, `${beyond} beyond range`] : [`${usable} of ${scan.codes.length} beams usable`];
  const blind = [NO_RETURN, TOO_CLOSE, INVALID].filter((code) => counts.get(code));
  if (blind.length === 1) parts.push(`${counts.get(blind[0])} hatched: ${codeWords(blind[0] ?? 0)}`);
  else if (blind.length > 1) parts.push(`hatched: ${blind.map((code) => `${counts.get(code)} ${codeWords(code)}`).join(', ')}`);
  const back = behind(scan);
  if (back) parts.push(`${back} behind, not drawn`);
  return parts.join(' · ');
}

/**
 * Where metres stand on a plot of this size: the car at the foot, ahead is up. `far_m` lies outside of it.
 * @param {number} width
 * @param {number} height
 * @param {number} reach_m
 */
export function plotScale(width, height, reach_m) {
  const cx = width / 2;
  const cy = height - 34;
  const k = Math.max(cy - 14, 1) / reach_m; // a plot too low for any still has a scale
  return { width, cx, cy, k, far_m: Math.max(cy + 8, 1) / k, at: (/** @type {number} */ x_m, /** @type {number} */ y_m) => /** @type {[number, number]} */ ([cx - y_m * k, cy - x_m * k]) };
}

/**
 * The place on the plane that a point of the plot shows.
 * @param {ReturnType<typeof plotScale>} scale
 * @param {number} x_px from its left edge
 * @param {number} y_px from its top
 */
export function placeOf({ cx, cy, k }, x_px, y_px) {
  return { x_m: (cy - y_px) / k, y_m: (cx - x_px) / k };
}

/**
 * Whether what reaches from one place to the other, ahead of the laser, lies over one of these sectors that is wide enough for a name.
 * @param {{x_m: number, y_m: number}[]} ends
 * @param {{x_m: number, y_m: number}} laser
 * @param {Sector[]} sectors
 */
export function liesOverSector(ends, laser, sectors) {
  const bearings_rad = ends.map(({ x_m, y_m }) => Math.atan2(y_m - laser.y_m, x_m - laser.x_m));
  const [low, high] = [Math.min(...bearings_rad), Math.max(...bearings_rad)];
  const wide = sectors.filter(({ from_rad, to_rad }) => to_rad - from_rad >= NAMED_RAD);
  return wide.some(({ from_rad, to_rad }) => [-2 * Math.PI, 0, 2 * Math.PI].some((turn) => from_rad + turn <= high && low <= to_rad + turn));
}

/** The rings of a plot, at round metres [m]. @param {number} reach_m */
export function ringsOf(reach_m) {
  const step = [1, 2, 5, 10, 20, 50].find((one) => one >= reach_m / 5) ?? 50;
  return Array.from({ length: Math.floor(reach_m / step + 1e-9) }, (_, i) => (i + 1) * step);
}

/**
 * Keeps a wished reach within what the plot can show.
 * @param {number} wished_m
 */
export function reachWithin(wished_m) {
  return Number.isFinite(wished_m) ? Math.min(REACH_M.most, Math.max(REACH_M.least, wished_m)) : REACH_M.first;
}

/**
 * The reach after a press of + (nearer) or − (farther); it halts at the keys' ranges on the way.
 * @param {number} reach_m
 * @param {1 | -1} sign 1: nearer
 */
export function zoomed(reach_m, sign) {
  const next = reachWithin(sign > 0 ? reach_m / ZOOM_STEP : reach_m * ZOOM_STEP);
  const halt = [10, 20, 40, 80].find((one) => one > Math.min(next, reach_m) * 1.001 && one < Math.max(next, reach_m) * 0.999);
  return halt ?? next;
}

/**
 * The reach while two fingers move: what they hold stays under them.
 * @param {number} reach_m when they touched
 * @param {number} apart_px then
 * @param {number} now_px
 */
export function pinched(reach_m, apart_px, now_px) {
  return reachWithin((reach_m * Math.max(apart_px, 20)) / Math.max(now_px, 20));
}

/** @typedef {{left: number, top: number, width: number, height: number}} Box */

/**
 * The box moved by at most its height up or down, to where it covers none of these and is below the top; null where there is no such place.
 * @param {Box[]} taken
 * @param {Box} box
 * @returns {Box | null}
 */
export function clearOf(taken, box) {
  const covers = (/** @type {number} */ top) => top < 0 || taken.some((one) =>
    box.left < one.left + one.width && one.left < box.left + box.width && top < one.top + one.height && one.top < top + box.height);
  const by = [0, -0.5, 0.5, -1, 1].find((share) => !covers(box.top + share * box.height));
  return by === undefined ? null : { ...box, top: box.top + by * box.height };
}

/** Whether a number of the plot is seen there whole: inside of its sides and beneath its top. @param {number[]} place @param {number} width */
export function isInView([x = 0, y = 0], width) {
  return Math.abs(x - width / 2) < width / 2 - 12 && y > HALF_NUMBER_PX;
}

/**
 * The first of these boxes that covers neither words nor a return, in its place or moved by clearOf; index -1: none does.
 * @param {Box[]} boxes
 * @param {Box[]} taken by words
 * @param {ArrayLike<number>} points as in coversAny
 * @param {{cx: number, cy: number, k: number}} scale
 * @returns {{index: number, box: Box | null}}
 */
export function clearPlace(boxes, taken, points, scale) {
  const found = boxes.map((one) => clearOf(taken, one));
  const index = found.findIndex((box) => box !== null && !coversAny(box, points, scale));
  return { index, box: found[index] ?? null };
}

/** What the distance beside the ring of the nearest object takes, and half of its width [px]. */
const RING_WORDS_PX = { beside: 120, half: 44 };

/**
 * Where the distance of the nearest object stands: right of its ring, left of it, or on a narrow plot above or below it.
 * @param {number} x @param {number} y of the ring [px]
 * @param {number} width of the plot [px]
 * @returns {{way: number, at: [number, number, CanvasTextAlign]}} `way` 0: neither side has room
 */
export function ringWords(x, y, width) {
  const { beside, half } = RING_WORDS_PX;
  if (x + beside <= width) return { way: 1, at: [x + 44, y - 1, 'left'] };
  if (x >= beside) return { way: -1, at: [x - 44, y - 1, 'right'] };
  return { way: 0, at: [Math.max(half, Math.min(width - half, x)), y < 48 ? y + 34 : y - 34, 'center'] };
}

/** Half the side of a drawn return [px]. */
const DOT_PX = 2.5;

/**
 * Does a box cover any of the returns that are drawn?
 * @param {Box} box [px]
 * @param {ArrayLike<number>} points x ahead and y left of each, one after the other [m]
 * @param {{cx: number, cy: number, k: number}} scale where the laser is on the plot, and pixels for a metre
 */
export function coversAny({ left, top, width, height }, points, { cx, cy, k }) {
  for (let i = 0; i < points.length; i += 2) {
    const [x, y] = [cx - (points[i + 1] ?? 0) * k, cy - (points[i] ?? 0) * k];
    if (x > left - DOT_PX && x < left + width + DOT_PX && y > top - DOT_PX && y < top + height + DOT_PX) return true;
  }
  return false;
}
