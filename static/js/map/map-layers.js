// The ground under the figure: tiles of map files by Leaflet, and the picture of the site. Neither is needed for the map,
// and Leaflet is fetched only where the server has tiles.

import { html, setAttribute } from '../core/dom.js';
import { fetchStyle } from '../core/style-sheet.js';
import { MERCATOR_END_DEG, pictureMatrix, tileScale } from './map-layout.js';

/**
 * @typedef {import('../core/geodesy.js').Place} Place
 * @typedef {import('./map-layout.js').View} View
 * @typedef {import('./map-layout.js').Size} Size
 * @typedef {{title: string, tiles: string, min_zoom: number, max_zoom: number, bounds: [number, number, number, number], attribution: string,
 *   upstream?: {host: string, problem: string | null, kept_bytes: number, limit_bytes: number, evicted: number}}} Layer upstream: where its tiles are fetched
 * @typedef {{source: string, corners: [number, number][], attribution: string}} Picture
 * @typedef {{layers: Layer[], image: Picture | null}} MapGround as GET /api/map has it
 */

const LEAFLET = '../../vendor/leaflet.js';
/** Tiles are laid anew when the view has gone so far from where they were laid [px]; until then they are only shifted. */
const SHIFT_PX = 64;
/** Tiles are stretched between this and 1.42 times their size. */
const LEAST_STRETCH = 0.7;
/** A layer whose tiles are fetched is queried so often while a tile of it is missing [ms]. */
const ASK_EVERY_MS = 10_000;

export class Ground {
  /** @type {import('leaflet').Map | null} */
  #map = null;
  #side = 0;
  /** @type {{element: HTMLImageElement, corners: Place[]} | null} */
  #picture = null;
  /** @type {Layer[]} */
  #layers = [];
  /** @type {Picture | null} */
  #image = null;
  /** @type {ReturnType<typeof setTimeout> | null} */
  #asking = null;
  #asked_ms = -Infinity;
  /** Tiles that should be fetched and are not there. @type {Set<HTMLImageElement>} */
  #missing = new Set();
  /** Whether anything lies there. */
  isThere = false;

  /** @param {HTMLElement} root @param {() => void} onChange */
  constructor(root, onChange) {
    this.root = root;
    this.onChange = onChange;
    this.tiles = html('div', { class: 'tiles' });
    root.append(this.tiles);
  }

  /** Fetches the list of layers, and the code that draws them. */
  async load() {
    const answer = await fetch('/api/map');
    if (!answer.ok) throw new Error(`status ${answer.status}`);
    const ground = /** @type {MapGround} */ (await answer.json());
    this.#layers = ground.layers;
    this.#image = ground.image;
    if (ground.image) this.#lay(ground.image);
    if (ground.layers.length) await this.#tile(ground.layers);
    this.isThere = ground.layers.length > 0 || ground.image !== null;
    this.onChange();
  }

  /** @param {Picture} image */
  #lay({ source, corners }) {
    const element = /** @type {HTMLImageElement} */ (html('img', { class: 'site', alt: '', src: source, draggable: 'false' }));
    this.#picture = { element, corners: corners.map(([lat_deg, lon_deg]) => ({ lat_deg, lon_deg })) };
    element.addEventListener('load', () => this.onChange());
    this.root.append(element);
  }

  /** @param {Layer[]} layers */
  async #tile(layers) {
    await Promise.all([import(LEAFLET), fetchStyle(new URL('../../vendor/leaflet.css', import.meta.url).href)]);
    const L = /** @type {typeof import('leaflet')} */ (/** @type {any} */ (globalThis).L);
    // It moves nothing by itself: the view is this map's own, and Leaflet is set to it.
    this.#map = L.map(this.tiles, {
      attributionControl: false, zoomControl: false, dragging: false, touchZoom: false, scrollWheelZoom: false, doubleClickZoom: false, boxZoom: false, keyboard: false,
      zoomAnimation: false, fadeAnimation: false, markerZoomAnimation: false, inertia: false, trackResize: false, maxZoom: 24,
    });
    for (const { tiles, min_zoom, max_zoom, bounds: [west, south, east, north], upstream } of layers) {
      const layer = L.tileLayer(tiles, { minZoom: min_zoom, maxNativeZoom: max_zoom, maxZoom: 24, bounds: [[south, west], [north, east]], updateWhenIdle: false, keepBuffer: 1 }).addTo(/** @type {import('leaflet').Map} */ (this.#map));
      if (!upstream) continue;
      layer.on('tileerror', ({ tile }) => {
        this.#missing.add(/** @type {HTMLImageElement} */ (tile));
        this.#askSoon();
      });
      const isThere = (/** @type {{tile: HTMLElement}} */ { tile }) => void this.#missing.delete(/** @type {HTMLImageElement} */ (tile));
      layer.on('tileload', isThere);
      layer.on('tileunload', isThere);
    }
  }

  /** Why is a tile missing? And once more for it: the server dials only when it is time to. */
  #askSoon() {
    if (this.#asking) return;
    this.#asking = setTimeout(async () => {
      this.#asking = null;
      if (!this.root.isConnected) return;
      this.#asked_ms = performance.now();
      const was = this.#problem;
      try {
        const answer = await fetch('/api/map');
        if (answer.ok) this.#layers = /** @type {MapGround} */ (await answer.json()).layers;
      } catch {
        // the server itself is gone: others say so
      }
      this.onChange();
      if (was === null && this.#problem === null) return; // there is no such tile
      for (const tile of this.#missing) tile.src = String(tile.src); // fetched again; if it fails again, this is queried again
    }, Math.max(0, this.#asked_ms + ASK_EVERY_MS - performance.now()));
  }

  /** Why tiles cannot be fetched, as the server last stated. @returns {string | null} */
  get #problem() {
    return this.#layers.find(({ upstream }) => upstream?.problem)?.upstream?.problem ?? null;
  }

  /** Where to look while no position is known: the middle of what there is. @returns {Place | null} */
  get middle() {
    if (this.#picture) {
      const [, right, below] = this.#picture.corners;
      if (right && below) return { lat_deg: (right.lat_deg + below.lat_deg) / 2, lon_deg: (right.lon_deg + below.lon_deg) / 2 };
    }
    const layer = this.#layers.at(-1);
    if (!layer) return null;
    const [west, south, east, north] = layer.bounds;
    return east - west > 20 ? null : { lat_deg: (south + north) / 2, lon_deg: (west + east) / 2 };
  }

  /**
   * The attribution of the ground, or why there is none here.
   * @param {View} view
   */
  caption(view) {
    if (!this.isThere) return '';
    const names = [...new Set([...this.#layers, ...(this.#image ? [this.#image] : [])].map(({ attribution }) => attribution).filter(Boolean))].join(' · ');
    const problem = this.#missing.size ? this.#problem : null;
    const here = this.#layers.length && !this.#layers.some((layer) => covers(layer, view)) ? 'No map tiles here.' : '';
    return [problem, here, names].filter(Boolean).join(' ');
  }

  /** @param {View} view @param {Size} size */
  draw(view, size) {
    this.#drawPicture(view, size);
    this.#drawTiles(view, size);
  }

  /** @param {View} view @param {Size} size */
  #drawPicture(view, size) {
    const picture = this.#picture;
    if (!picture) return;
    const { naturalWidth: width, naturalHeight: height } = picture.element;
    if (width && height) picture.element.style.transform = `matrix(${pictureMatrix(picture.corners, { width, height }, view, size).map((one) => one.toFixed(6)).join(',')})`;
  }

  /** @param {View} view @param {Size} size */
  #drawTiles(view, size) {
    const map = this.#map;
    const isShown = map !== null && Math.abs(view.centre.lat_deg) < MERCATOR_END_DEG;
    setAttribute(this.tiles, 'hidden', !isShown);
    if (!map || !isShown || !size.width || !size.height) return;
    this.#resize(map, size);
    const { zoom, x, y } = tileScale(view);
    const { lat_deg, lon_deg } = view.centre;
    /** @type {{x: number, y: number} | null} */
    let shift = this.#shift(map, zoom, lat_deg, lon_deg);
    if (!shift || Math.abs(shift.x) > SHIFT_PX || Math.abs(shift.y) > SHIFT_PX) {
      map.setView([lat_deg, lon_deg], zoom, { animate: false });
      shift = this.#shift(map, zoom, lat_deg, lon_deg) ?? { x: 0, y: 0 };
    }
    this.tiles.style.transform = `translate(-50%, -50%) rotate(${-view.up_deg}deg) scale(${x}, ${y}) translate(${-shift.x}px, ${-shift.y}px)`;
  }

  /** How far the view has gone from where the tiles are laid [px of theirs]; null: not of this zoom. @param {import('leaflet').Map} map @param {number} zoom @param {number} lat_deg @param {number} lon_deg */
  #shift(map, zoom, lat_deg, lon_deg) {
    let laid;
    try {
      laid = map.getCenter();
    } catch {
      return null; // not yet laid
    }
    if (map.getZoom() !== zoom) return null;
    const near_deg = lon_deg + 360 * Math.round((laid.lng - lon_deg) / 360); // over the antimeridian it is not far
    return map.project([lat_deg, near_deg], zoom).subtract(map.project(laid, zoom));
  }

  /** A square that covers the map however it is turned. @param {import('leaflet').Map} map @param {Size} size */
  #resize(map, size) {
    const side = 2 * Math.ceil((Math.hypot(size.width, size.height) / LEAST_STRETCH + 2 * SHIFT_PX) / 2);
    if (side === this.#side) return;
    this.#side = side;
    this.tiles.style.width = this.tiles.style.height = `${side}px`;
    map.invalidateSize({ animate: false, pan: false });
  }
}

/** @param {Layer} layer @param {View} view */
function covers({ min_zoom, bounds: [west, south, east, north] }, { centre, mpp, up_deg }) {
  const { lat_deg, lon_deg } = centre;
  return lat_deg >= south && lat_deg <= north && lon_deg >= west && lon_deg <= east && tileScale({ centre, mpp, up_deg }).zoom >= min_zoom;
}
