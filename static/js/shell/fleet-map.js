// The map of all cars: an SVG of our own, north up, a grid of round lengths; each car is moved, never made anew.

import { field, need, setAttribute, setText, setSentence, show, svg } from '../core/dom.js';
import { dotsOf, lengthWords, mapWords, namesAt, stepOf, viewOf } from './fleet-map-layout.js';

/** From so many cars on only those that need a person are named. */
const NAMED = 20;
const OCTAGON = 'M-9-22H9L22-9V9L9 22H-9L-22 9V-9z';
const TRIANGLE = 'M0-27 25 19H-25z';
const ARROW = 'M0-11 7 9 0 5-7 9z';

/**
 * @typedef {import('./fleet-map-layout.js').Dot} Dot
 * @typedef {{group: SVGElement, shape: SVGElement, arrow: SVGElement, name: SVGElement}} Car
 */

export class FleetMap {
  /** @type {Map<string, Car>} */
  #cars = new Map();
  /** @type {import('../core/geodesy.js').Place | null} */
  #from = null;
  /** @type {import('./fleet-map-layout.js').View | null} */
  #view = null;
  #size = '';
  #grid = '';

  /** @param {HTMLElement} root @param {(name: string) => void} open */
  constructor(root, open) {
    this.open = open;
    this.root = field(root, 'map');
    this.head = field(root, 'where-head');
    this.width = this.height = 0;
    this.lines = svg('g', { class: 'lines' });
    this.flood = svg('g', { class: 'hull' }, svg('g', { class: 'a' }), svg('g', { class: 'b' }), svg('g', { class: 'c' }));
    this.cars = svg('g');
    this.scale = svg('g', { class: 'scale' }, svg('path'), svg('text', { x: 4, y: -8 }));
    this.north = svg('g', { class: 'north', transform: 'translate(26 26)' }, svg('path', { d: 'M0-14 7 6 0 2-7 6z' }), svg('text', { y: 22 }, 'N'));
    this.empty = svg('text', { class: 'empty' });
    const hatch = svg('pattern', { id: 'fleet-hatch', width: 8, height: 8, patternUnits: 'userSpaceOnUse', patternTransform: 'rotate(45)' }, svg('path', { class: 'hatchline', d: 'M0 0V8' }));
    this.root.append(svg('defs', {}, hatch), this.lines, this.flood, this.cars, this.north, this.scale, this.empty);
    new ResizeObserver(([entry]) => {
      if (entry) [this.width, this.height] = [Math.round(entry.contentRect.width), Math.round(entry.contentRect.height)];
    }).observe(this.root);
  }

  /**
   * @param {import('./fleet-layout.js').Seen} seen
   * @param {Map<string, 'crit' | 'warn' | ''>} kinds
   * @param {Set<string>} floods cars in a flood
   * @param {string} then the text of the head where all positions are old
   */
  draw(seen, kinds, floods, then) {
    const { dots, far, without, from } = dotsOf(seen, kinds, floods, this.#from);
    this.#from = from;
    const text = mapWords(seen.cars?.cars.length ?? 0, dots, without, far);
    setSentence(this.head, then || text);
    setAttribute(this.root, 'aria-label', `Map of all cars: ${then || text}`);
    const { width, height } = this;
    if (width < 40 || height < 40) return; // out of sight
    const size = `${width} ${height}`;
    if (size !== this.#size) setAttribute(this.root, 'viewBox', `0 0 ${size}`);
    const view = viewOf(dots, width, height, size === this.#size ? this.#view : null);
    this.#size = size;
    this.#view = view;
    this.#drawGrid(view);
    const isMany = dots.length >= NAMED;
    const at = dots.map((dot) => ({ dot, x: width / 2 + (dot.east_m - view.east_m) / view.m_per_px, y: height / 2 - (dot.north_m - view.north_m) / view.m_per_px }));
    this.#drawFlood(at);
    this.#drawCars(at, isMany);
    const none = !dots.length;
    show(this.empty, none);
    show(this.scale, !none);
    setText(this.empty, seen.cars?.cars.length ? 'No car has a position' : '');
    setAttribute(this.empty, 'x', width / 2);
    setAttribute(this.empty, 'y', height / 2);
  }

  /** @param {import('./fleet-map-layout.js').View} view */
  #drawGrid(view) {
    const { width, height } = this;
    const step_m = stepOf(view);
    const key = `${view.east_m} ${view.north_m} ${view.m_per_px} ${this.#size}`;
    if (key === this.#grid) return;
    this.#grid = key;
    const step = step_m / view.m_per_px;
    const first = (/** @type {number} */ middle_px, /** @type {number} */ at_m) => ((middle_px - at_m / view.m_per_px) % step + step) % step;
    let d = '';
    for (let x = first(width / 2, view.east_m); x < width; x += step) d += `M${x.toFixed(1)} 0V${height}`;
    for (let y = first(height / 2, -view.north_m); y < height; y += step) d += `M0 ${y.toFixed(1)}H${width}`;
    this.lines.replaceChildren(svg('path', { d }));
    setAttribute(this.scale, 'transform', `translate(16 ${height - 16})`);
    setAttribute(need(this.scale, 'path'), 'd', `M0-6V0H${step.toFixed(1)}V-6`);
    setText(need(this.scale, 'text'), lengthWords(step_m));
  }

  /** One hatched outline around the silent cars of a flood. @param {{dot: Dot, x: number, y: number}[]} at */
  #drawFlood(at) {
    const around = at.filter(({ dot }) => dot.isFlood);
    [...this.flood.children].forEach((layer, i) => {
      const r = i === 0 ? 18 : 15.5;
      while (layer.children.length > around.length) layer.lastElementChild?.remove();
      while (layer.children.length < around.length) layer.append(svg('circle', { r }));
      around.forEach(({ x, y }, n) => {
        const circle = /** @type {Element} */ (layer.children[n]);
        setAttribute(circle, 'cx', x.toFixed(0));
        setAttribute(circle, 'cy', y.toFixed(0));
      });
    });
  }

  /** @param {{dot: Dot, x: number, y: number}[]} at @param {boolean} isMany */
  #drawCars(at, isMany) {
    const small = isMany ? 0.7 : 1;
    const arrow = at.length > 60 ? 0.55 : small;
    const wanted = at.filter(({ dot }) => !isMany || (dot.kind !== '' && !dot.isFlood)).sort((a, b) => weight(b.dot) - weight(a.dot))
      .map(({ dot, x, y }) => ({ name: dot.name, x, y, width: 8.2 * Math.min(18, dot.name.length) + 4, around: dot.kind || !dot.isLive ? 22 * small : 10 * small }));
    const names = namesAt(wanted, at, this.width, this.height);
    const shown = new Set();
    for (const { dot, x, y } of at) {
      const car = this.#cars.get(dot.name) ?? this.#made(dot.name);
      shown.add(dot.name);
      setAttribute(car.group, 'transform', `translate(${x.toFixed(1)} ${y.toFixed(1)})`);
      setAttribute(car.group, 'data-kind', dot.kind || null);
      setAttribute(car.group, 'data-old', !dot.isLive);
      const hasShape = !dot.isFlood && (dot.kind !== '' || !dot.isLive);
      setAttribute(car.shape, 'd', hasShape ? (dot.kind === 'warn' ? TRIANGLE : OCTAGON) : null);
      setAttribute(car.shape, 'transform', `scale(${small})`);
      setAttribute(car.arrow, 'd', dot.turn_deg === null ? 'M-6 0a6 6 0 1 0 12 0a6 6 0 1 0-12 0' : ARROW);
      setAttribute(car.arrow, 'transform', `rotate(${(dot.turn_deg ?? 0).toFixed(0)}) scale(${arrow})`);
      const place = names.get(dot.name);
      show(car.name, place !== undefined);
      if (!place) continue;
      setText(car.name, dot.name.length > 18 ? `${dot.name.slice(0, 17)}…` : dot.name);
      setAttribute(car.name, 'x', (place.x - x).toFixed(1));
      setAttribute(car.name, 'y', (place.y - y + 5).toFixed(1));
      setAttribute(car.name, 'text-anchor', place.anchor);
    }
    for (const [name, car] of this.#cars) show(car.group, shown.has(name));
  }

  /** @param {string} name @returns {Car} */
  #made(name) {
    const [shape, arrow, text] = [svg('path', { class: 'shape' }), svg('path', { class: 'arrow' }), svg('text')];
    const car = { group: svg('g', { class: 'car' }, svg('circle', { class: 'hit', r: 22 }), shape, arrow, text), shape, arrow, name: text };
    car.group.addEventListener('click', () => this.open(name));
    this.#cars.set(name, car);
    this.cars.append(car.group);
    return car;
  }
}

/** @param {Dot} dot */
function weight(dot) {
  return (dot.kind === 'crit' ? 4 : dot.kind === 'warn' ? 2 : 0) + (dot.isLive ? 0 : 1);
}
