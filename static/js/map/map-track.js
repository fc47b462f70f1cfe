// The track on the page: requested by number, whole when the page came late, and drawn as lines that end where the way is
// not known.

import { offsetOf } from '../core/geodesy.js';

/**
 * @typedef {import('../core/geodesy.js').Place} Place
 * @typedef {{number: number, lat_deg: number, lon_deg: number, at_s: number, joins: number}} Point joins: 0 driven, 1 after a gap, 2 leapt
 */

/** More points than this are thinned here too: every other one [points]. */
export const MOST = 4000;
/** Requested at most so often [ms]; after a failure, so much later. */
const EVERY_MS = 1000;
const AGAIN_MS = 3000;
/** A dot on the track each so many seconds. */
const DOT_S = 10;

/** The points of one track, bounded. */
export class Track {
  /** Which track it is; another key is another car or another connection. @type {string | null} */
  key = null;
  /** @type {Point[]} */
  points = [];
  /** Changes whenever the points do. */
  version = 0;

  get last() {
    return this.points.at(-1)?.number ?? 0;
  }

  /**
   * From which point on this page lacks the track; null: it lacks nothing.
   * @param {string} key
   * @param {number} last newest point there is
   */
  lacks(key, last) {
    if (key !== this.key) {
      this.key = key;
      this.points = [];
      this.version += 1;
    }
    return last > this.last ? this.last : null;
  }

  /**
   * The rows of an answer: those of another track, or that are there already, are left out.
   * @param {string} key
   * @param {unknown} rows
   */
  take(key, rows) {
    if (key !== this.key || !Array.isArray(rows)) return;
    let last = this.last;
    for (const row of rows) {
      if (!Array.isArray(row) || row.length < 5 || !row.slice(0, 5).every(Number.isFinite) || row[0] <= last || Math.abs(row[1]) > 90) continue;
      last = row[0];
      this.points.push({ number: row[0], lat_deg: row[1], lon_deg: row[2], at_s: row[3], joins: row[4] });
    }
    if (this.points.length > MOST) {
      this.points = this.points.filter((point, i, all) => i % 2 === 0 || point.joins > 0 || i === all.length - 1).slice(-MOST);
    }
    this.version += 1;
  }
}

/**
 * The track as SVG paths in metres east and north of an anchor: ways driven, ways not seen, and a dot each ten seconds.
 * @param {Point[]} points
 * @param {Place} anchor
 */
export function trackPaths(points, anchor) {
  const paths = { driven: '', unseen: '', dots: '' };
  let before = '';
  let tick = NaN;
  for (const point of points) {
    const { east_m, north_m } = offsetOf(anchor, point);
    const here = `${east_m.toFixed(2)} ${north_m.toFixed(2)}`;
    if (before && point.joins === 0) paths.driven += `L${here}`;
    else paths.driven += `M${here}`;
    if (before && point.joins === 1) paths.unseen += `M${before}L${here}`;
    const now = Math.floor(point.at_s / DOT_S);
    if (before && point.joins === 0 && now !== tick) paths.dots += `M${here}h0`;
    tick = now;
    before = here;
  }
  return paths;
}

/** Fetches from the server what the track lacks. */
export class TrackFeed {
  track = new Track();
  #isAsking = false;
  #next_ms = 0;

  /** @param {() => void} onChange */
  constructor(onChange) {
    this.onChange = onChange;
  }

  /** @param {import('../core/protocol-types.js').State} frame @param {number} now_ms */
  look(frame, now_ms) {
    const { track } = frame.session;
    if (!track) return;
    const { replay } = frame;
    const boot = frame.server.boot + (replay?.token ?? '');
    const key = `${boot} ${track.number}`;
    const version = this.track.version;
    const after = this.track.lacks(key, track.last);
    if (version !== this.track.version) this.onChange();
    if (after === null || this.#isAsking || now_ms < this.#next_ms) return;
    this.#isAsking = true;
    this.#next_ms = now_ms + EVERY_MS;
    this.#ask(key, boot, after, `&vehicle=${encodeURIComponent(frame.vehicle)}${replay ? `&replay=${replay.token}` : ''}`).catch(() => { this.#next_ms = now_ms + AGAIN_MS; }).finally(() => { this.#isAsking = false; });
  }

  /** @param {string} key @param {string} boot @param {number} after @param {string} whose */
  async #ask(key, boot, after, whose) {
    const answer = await fetch(`/api/track/points?after=${after}${whose}`);
    if (!answer.ok) throw new Error(`status ${answer.status}`);
    const { number, points } = await answer.json();
    if (`${boot} ${number}` !== key) return; // another track began meanwhile: the next state has its number
    this.track.take(key, points);
    this.onChange();
  }
}
