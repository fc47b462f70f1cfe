// Draws the scan from above on a canvas, over the grid of scan-grid.js.

import { edgesOf, endOf } from './scan-corridor.js';
import { bearingOf, rangeOf } from './scan-frame.js';
import { clearOf, clearPlace, codeWords, isInView, liesOverSector, namedSectors, placeOf, plotScale, pointsOf, ringWords, ringsOf, sectorsOf, unseenOf } from './scan-layout.js';
import { Hatching, ScanGrid, fit, penOf } from './scan-grid.js';
import { fixed } from '../core/format.js';

const NAMES_SHOWN = 4;
/** Where the number of a ring stands, left of ahead [rad]. */
const RING_TURN = 0.33;
/** Or there, if returns are at that place: over a number they hide it, and it must hide none. */
const OTHER_TURNS = [-0.33, 0.72, -0.72, 1.1, -1.1];

/**
 * @typedef {import('./scan-corridor.js').Point} Point
 * @typedef {ReturnType<typeof plotScale>} Scale
 * @typedef {import('./scan-grid.js').Surface} Surface
 * @typedef {import('./scan-grid.js').Pen} Pen
 * @typedef {import('./scan-layout.js').Box} Box
 * @typedef {{x: number, y: number, way: number, text: string, where: Where}} Nearest
 * @typedef {[x: number, y: number, align: CanvasTextAlign, size: number, weight: number]} Where of a label
 *
 * @typedef {object} Around what is drawn beside the scan
 * @property {number} reach_m
 * @property {Omit<import('./scan-corridor.js').Corridor, 'tyre_angle_rad'> | null} car null: its measures are not known yet
 * @property {number | null} limit_m
 * @property {{x_m: number, y_m: number, isSeen: boolean} | null} mark the return that the operator marked
 */

/**
 * @typedef {object} Picture all that one drawing needs
 * @property {import('./scan-frame.js').Scan} scan
 * @property {Around} around
 * @property {number} width [CSS px]
 * @property {number} height [CSS px]
 * @property {number} dpr pixels of the canvas for one of CSS
 * @property {import('./scan-theme.js').Theme} theme
 * @property {Box | null} caption what covers the plot, and grows with the font
 */

export class ScanPlot {
  #grid = new ScanGrid();
  #hatching = new Hatching();
  /** @type {import('./scan-theme.js').Theme['colour']} */
  #colour = /** @type {any} */ ({});
  #font = '';
  #width = 0;
  /** The boxes of the labels drawn already. @type {Box[]} */
  #taken = [];
  /** The returns, which the labels of a line and the numbers of the rings keep clear of. @type {{scale: Scale, points: Float32Array, isHatched: (where: Where) => boolean} | null} */
  #dots = null;
  /** Where the number of a ring stood: it stays there while no return comes there. @type {Map<number, number>} */
  #turns = new Map();

  /** @param {Surface} canvas */
  constructor(canvas) {
    this.canvas = canvas;
  }

  /** @param {Picture} picture */
  draw({ scan, around, width, height, dpr, theme, caption }) {
    fit(this.canvas, Math.round(width * dpr), Math.round(height * dpr));
    const g = penOf(this.canvas, { alpha: false });
    if (!g) return;
    ({ colour: this.#colour, font: this.#font } = theme);
    this.#width = width;
    this.#taken = caption ? [caption] : [];
    const { reach_m } = around;
    g.setTransform(1, 0, 0, 1, 0, 0);
    g.drawImage(this.#grid.draw({ width, height, dpr, reach_m, theme }), 0, 0);
    g.setTransform(dpr, 0, 0, dpr, 0, 0);
    const scale = plotScale(width, height, reach_m);
    const sectors = [...sectorsOf(scan), ...unseenOf(scan)];
    const { tyre_angle_rad, wider_m } = scan.judged;
    const corridor = around.car ? { ...around.car, half_width_m: around.car.half_width_m + wider_m, tyre_angle_rad } : null;
    if (corridor) this.#stoppingStrip(g, scale, corridor, scan.judged.stopping_m);
    this.#hatch(g, scale, scan, sectors, width + height, dpr, theme.key);
    const { points } = (this.#dots = { scale, points: pointsOf(scan, reach_m * 1.05, 1 / scale.k), isHatched: hatchedBy(scale, scan, sectors) });
    const nearest = this.#nearestAt(g, scale, scan, reach_m); // all other labels keep its room free
    if (corridor) this.#corridor(g, scale, corridor, reach_m, scan.judged.stopping_m, around.limit_m);
    this.#names(g, scale, scan, reach_m, sectors, width);
    this.#rings(g, scale, reach_m);
    this.#points(g, scale, points);
    if (nearest) this.#nearest(g, nearest);
    if (around.mark) this.#mark(g, scale, around.mark);
    this.#car(g, scale, height);
  }

  /** The part of the corridor that the car needs to stop. @param {Pen} g @param {Scale} scale @param {import('./scan-corridor.js').Corridor} corridor @param {number | null} stopping_m */
  #stoppingStrip(g, scale, corridor, stopping_m) {
    if (!stopping_m) return;
    const { left, right } = edgesOf(corridor, 0, Math.min(stopping_m, endOf(corridor, scale.far_m)));
    g.beginPath();
    trace(g, scale, [...left, ...right.reverse()]);
    g.closePath();
    g.fillStyle = this.#colour.raise;
    g.fill();
  }

  /** @param {Pen} g @param {Scale} scale @param {import('./scan-frame.js').Scan} scan @param {import('./scan-layout.js').Sector[]} sectors @param {number} far @param {number} dpr @param {string} look */
  #hatch(g, { at }, { x_m = 0, y_m = 0 }, sectors, far, dpr, look) {
    if (!sectors.length) return;
    const [cx, cy] = at(x_m, y_m);
    g.beginPath();
    for (const { from_rad, to_rad } of sectors) {
      g.moveTo(cx, cy);
      if (to_rad - from_rad > 0.3) g.arc(cx, cy, far, -Math.PI / 2 - to_rad, -Math.PI / 2 - from_rad);
      else for (const a of [to_rad, from_rad]) g.lineTo(cx - far * Math.sin(a), cy - far * Math.cos(a));
      g.closePath();
    }
    g.fillStyle = this.#colour.panel;
    g.fill();
    const hatching = this.#hatching.of(g, dpr, this.#colour.hatch, look);
    if (hatching) g.fillStyle = hatching;
    g.fill();
  }

  /** @param {Pen} g @param {Scale} scale @param {import('./scan-corridor.js').Corridor} corridor @param {number} reach_m @param {number | null} stopping_m @param {number | null} limit_m */
  #corridor(g, scale, corridor, reach_m, stopping_m, limit_m) {
    const colour = this.#colour;
    const end_m = endOf(corridor, scale.far_m);
    const stop_m = Math.min(stopping_m ?? 0, end_m);
    g.strokeStyle = colour.ink2;
    g.lineWidth = 2;
    for (const [from_m, to_m, dashes] of /** @type {[number, number, number[]][]} */ ([[0, stop_m, []], [stop_m, end_m, [7, 5]]])) {
      if (to_m <= from_m) continue;
      const { left, right } = edgesOf(corridor, from_m, to_m);
      g.setLineDash(dashes);
      g.beginPath();
      trace(g, scale, left);
      trace(g, scale, right);
      g.stroke();
    }
    g.setLineDash([]);
    if (stopping_m !== null && stopping_m > 0 && stopping_m <= end_m) {
      this.#besides(g, `stop ${fixed(stopping_m)} m`, this.#across(g, scale, corridor, stopping_m, colour.ink, 5, 5), 400, colour.ink);
    }
    if (limit_m !== null && limit_m > 0 && limit_m <= end_m) {
      this.#besides(g, `limit ${fixed(limit_m)} m`, this.#across(g, scale, corridor, limit_m, colour.you, 3, 0).reverse(), 700, colour.you);
    }
  }

  /** Names a line across the corridor: beside its first end, else its other one, else further out with a thin line to it. @param {Pen} g @param {string} text @param {Point[]} ends @param {number} weight @param {string} css */
  #besides(g, text, ends, weight, css) {
    const places = placesBeside(ends, this.#width, weight).sort((a, b) => Number(this.#dots?.isHatched(a.where)) - Number(this.#dots?.isHatched(b.where)));
    const found = places[this.#clear(g, text, places.map(({ where }) => where), css)];
    if (found?.isFar) thinLine(g, found.end, [found.where[0] + (found.where[2] === 'left' ? -4 : 4), midOf(this.#taken.at(-1), found.end[1])], css);
  }

  /**
   * A line across the corridor; gives its ends on the plot.
   * @returns {Point[]}
   * @param {Pen} g @param {Scale} scale @param {import('./scan-corridor.js').Corridor} corridor @param {number} way_m @param {string} colour @param {number} width @param {number} beyond_px
   */
  #across(g, scale, corridor, way_m, colour, width, beyond_px) {
    const { left, right } = edgesOf(corridor, way_m, way_m);
    if (!left[0] || !right[0]) return [];
    const [a, b] = [scale.at(...left[0]), scale.at(...right[0])];
    const long = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
    const [dx, dy] = [((b[0] - a[0]) / long) * beyond_px, ((b[1] - a[1]) / long) * beyond_px];
    g.strokeStyle = colour;
    g.lineWidth = width;
    g.beginPath();
    g.moveTo(a[0] - dx, a[1] - dy);
    g.lineTo(b[0] + dx, b[1] + dy);
    g.stroke();
    return [[a[0] - dx, a[1] - dy], b];
  }

  /** @param {Pen} g @param {Scale} scale @param {number} reach_m */
  #rings(g, { at }, reach_m) {
    for (const r of ringsOf(reach_m)) {
      const place = (/** @type {number} */ turn) => at(r * Math.cos(turn), r * Math.sin(turn));
      const turns = [this.#turns.get(r) ?? RING_TURN, RING_TURN, ...OTHER_TURNS].filter((turn) => isInView(place(turn), this.#width));
      const index = this.#clear(g, String(r), turns.map((turn) => [...place(turn), 'center', 14, 400]), this.#colour.ink2);
      if (index >= 0) this.#turns.set(r, turns[index] ?? RING_TURN);
      else if (isInView(place(RING_TURN), this.#width)) this.#label(g, String(r), ...place(RING_TURN), this.#colour.ink2, 'center');
    }
  }

  /** @param {Pen} g @param {Scale} scale @param {import('./scan-frame.js').Scan} scan @param {number} reach_m @param {import('./scan-layout.js').Sector[]} sectors @param {number} width */
  #names(g, { cx, k, at }, { x_m = 0, y_m = 0 }, reach_m, sectors, width) {
    for (const sector of namedSectors(sectors, NAMES_SHOWN)) {
      const a = (sector.from_rad + sector.to_rad) / 2;
      if (Math.cos(a) < 0) continue; // behind: not in the picture
      const aside = Math.abs(Math.sin(a));
      // As far out as the edge allows, so that the label is where its sector is wide.
      const r = Math.min(Math.max(reach_m * 0.36, Math.min(NAME_OUT_PX / k, reach_m * 0.8)), aside > 0.05 ? (cx - 44) / (k * aside) : reach_m);
      const [x, y] = at(r * Math.cos(a) + x_m, r * Math.sin(a) + y_m);
      this.#label(g, codeWords(sector.code), Math.min(width - 42, Math.max(42, x)), y, this.#colour.ink, 'center', 14, 700);
    }
  }

  /** @param {Pen} g @param {Scale} scale @param {Float32Array} points */
  #points(g, { cx, cy, k }, points) {
    g.fillStyle = this.#colour.ink;
    g.beginPath();
    for (let i = 0; i < points.length; i += 2) g.rect(cx - (points[i + 1] ?? 0) * k - 2.5, cy - (points[i] ?? 0) * k - 2.5, 5, 5);
    g.fill();
  }

  /** What the obstacle check found, and on which side its label is. @param {Pen} g @param {Scale} scale @param {import('./scan-frame.js').Scan} scan @param {number} reach_m @returns {Nearest | null} */
  #nearestAt(g, { at }, scan, reach_m) {
    const { beam, gap_m } = scan.judged;
    const range_m = beam === null ? null : rangeOf(scan, beam);
    if (beam === null || range_m === null || range_m > reach_m) return null;
    const bearing_rad = bearingOf(scan, beam);
    const [x, y] = at(range_m * Math.cos(bearing_rad) + (scan.x_m ?? 0), range_m * Math.sin(bearing_rad) + (scan.y_m ?? 0));
    const { way, at: place } = ringWords(x, y, this.#width);
    const text = `${fixed(gap_m)} m`;
    const where = /** @type {Where} */ ([...place, 22, 700]);
    this.#taken.push(this.#plate(g, text, ...where));
    return { x, y, way, text, where };
  }

  /** @param {Pen} g @param {Nearest} nearest */
  #nearest(g, { x, y, way, text, where }) {
    this.#ring(g, x, y, this.#colour.ink);
    g.beginPath();
    g.moveTo(x + 15 * way, y);
    g.lineTo(x + 36 * way, y);
    g.stroke();
    write(g, text, this.#plate(g, text, ...where), { panel: this.#colour.panel, css: this.#colour.ink });
  }

  /** Its text is under the plot: here it would hide other returns. @param {Pen} g @param {Scale} scale @param {NonNullable<Around['mark']>} mark */
  #mark(g, { at }, mark) {
    if (!mark.isSeen) g.setLineDash([4, 4]);
    this.#ring(g, ...at(mark.x_m, mark.y_m), this.#colour.you);
    g.setLineDash([]);
  }

  /** @param {Pen} g @param {number} x @param {number} y @param {string} colour */
  #ring(g, x, y, colour) {
    g.strokeStyle = colour;
    g.lineWidth = 3;
    g.beginPath();
    g.arc(x, y, 15, 0, 7);
    g.stroke();
  }

  /** The car, its nose at the foot of the plot. @param {Pen} g @param {Scale} scale @param {number} height */
  #car(g, { cx, cy, k }, height) {
    const half = Math.min(60, Math.max(7, 0.9 * k));
    g.strokeStyle = this.#colour.ink;
    g.fillStyle = this.#colour.panel;
    g.lineWidth = 2.5;
    g.lineJoin = 'round';
    g.beginPath();
    g.moveTo(cx - half * 0.7, cy);
    g.lineTo(cx + half * 0.7, cy);
    g.lineTo(cx + half, cy + 12);
    g.lineTo(cx + half, height + 4);
    g.lineTo(cx - half, height + 4);
    g.lineTo(cx - half, cy + 12);
    g.closePath();
    g.fill();
    g.stroke();
    g.beginPath();
    g.moveTo(cx - half, cy + 22);
    g.lineTo(cx + half, cy + 22);
    g.stroke();
  }

  /** Draws a label where nothing else is written, a line higher or lower; else not. @param {Pen} g @param {string} text @param {number} x @param {number} y @param {string} css @param {CanvasTextAlign} [align] @param {number} [size] @param {number} [weight] */
  #label(g, text, x, y, css, align = 'left', size = 14, weight = 400) {
    const plate = clearOf(this.#taken, this.#plate(g, text, x, y, align, size, weight));
    if (!plate) return;
    this.#taken.push(plate);
    write(g, text, plate, { panel: this.#colour.panel, css });
  }

  /** Draws a label in the first place where it covers neither a label nor a return; else not: the numbers beside the plot have them. @param {Pen} g @param {string} text @param {Where[]} places @param {string} css @returns {number} which place; -1: none */
  #clear(g, text, places, css) {
    if (!this.#dots) return -1;
    const { index, box } = clearPlace(places.map((where) => this.#plate(g, text, ...where)), this.#taken, this.#dots.points, this.#dots.scale);
    if (!box) return -1;
    this.#taken.push(box);
    write(g, text, box, { panel: this.#colour.panel, css });
    return index;
  }

  /** The plate of a text. @param {Pen} g @param {string} text @param {number} x @param {number} y @param {CanvasTextAlign} align @param {number} size @param {number} weight @returns {Box} */
  #plate(g, text, x, y, align, size, weight) {
    g.font = `${weight} ${size}px ${this.#font}`;
    const width = g.measureText(text).width + 8;
    const left = align === 'left' ? x - 4 : align === 'right' ? x - width + 4 : x - width / 2;
    return { left, top: y - size * 0.72, width, height: size * 1.44 };
  }
}

/** At least this far from the laser the name of a sector stands on a small plot: nearer it would cover the sector [px]. */
const NAME_OUT_PX = 96;
/** The width of the label of a line [px]. */
const LABEL_PX = 84;

/** Where a label of a line may stand, best first. @param {Point[]} ends of the line @param {number} width of the plot [px] @param {number} weight */
function placesBeside(ends, width, weight) {
  const [first, other] = ends;
  if (!first || !other || first[1] <= 0) return [];
  return [0, 28, 56, 84].flatMap((out) => [first, other].map((end) => {
    const isLeft = end[0] === Math.min(first[0], other[0]);
    const x = isLeft ? Math.max(100, end[0] - 10 - out) : Math.min(width - 92, end[0] + 12 + out);
    return { end, isFar: out > 0, where: /** @type {Where} */ ([x, end[1], isLeft ? 'right' : 'left', 14, weight]) };
  }));
}

/** Whether a label would lie over a hatched sector, which would look free there. @param {Scale} scale @param {import('./scan-frame.js').Scan} scan @param {import('./scan-layout.js').Sector[]} sectors @returns {(where: Where) => boolean} */
function hatchedBy(scale, { x_m = 0, y_m = 0 }, sectors) {
  return ([x, y, align]) => liesOverSector([placeOf(scale, x, y), placeOf(scale, x + (align === 'left' ? LABEL_PX : -LABEL_PX), y)], { x_m, y_m }, sectors);
}

/** @param {Pen} g @param {Point} from @param {Point} to @param {string} css */
function thinLine(g, from, to, css) {
  g.strokeStyle = css;
  g.lineWidth = 1;
  g.beginPath();
  g.moveTo(...from);
  g.lineTo(...to);
  g.stroke();
}

/** The middle of a label that was drawn [px]. @param {Box | undefined} box @param {number} otherwise */
function midOf(box, otherwise) {
  return box ? box.top + box.height / 2 : otherwise;
}

/** Draws a text on its plate, which has the panel's colour, in the font that measured it. @param {Pen} g @param {string} text @param {Box} plate @param {{panel: string, css: string}} colours */
function write(g, text, { left, top, width, height }, { panel, css }) {
  g.textAlign = 'left';
  g.textBaseline = 'middle';
  g.fillStyle = panel;
  g.fillRect(left, top, width, height);
  g.fillStyle = css;
  g.fillText(text, left + 4, top + height / 2);
}

/** A line through points of the plane, its part behind the laser left out. @param {Pen} g @param {Scale} scale @param {Point[]} points */
function trace(g, { at }, points) {
  let isFirst = true;
  for (const [x_m, y_m] of points) {
    if (x_m < -0.01) continue;
    if (isFirst) g.moveTo(...at(x_m, y_m));
    else g.lineTo(...at(x_m, y_m));
    isFirst = false;
  }
}
