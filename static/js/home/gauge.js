// The gauge: speed over 180°, acceleration within, the operator's limit at the edge.

import { html, need, setAttribute, setText, show, svg } from '../core/dom.js';
import { accelerationAngle, band, digitsBox, faceOf, orderMark, speedAngle } from './gauge-layout.js';
import { ABSENT, isAbsent } from '../core/ink.js';
import { orderOf } from '../slowdown/slow-layout.js';
import { speedIn, speedUnit, speedWords, spokenSpeedUnit } from '../core/units.js';
import { proposalOf, unseenOf, unseenWords } from '../core/unseen.js';
import { age, signed } from '../core/format.js';

const VIEW = '0 0 380 250';

/** @typedef {{speed_max_mps: number, acceleration_max_mps2: number, limit_mps: number | null}} Scale */

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @returns {() => void}
 */
export function mount(root, store) {
  const gauge = new Gauge(root, store);
  gauge.move();
  if (store.frame) gauge.draw(); // before the first frame it is not shown
  const watcher = new IntersectionObserver((entries) => {
    gauge.isSeen = entries.at(-1)?.isIntersecting ?? true;
    gauge.move();
  });
  watcher.observe(root);
  const stops = [store.on('move', () => gauge.move()), store.on('draw', () => gauge.draw()), () => watcher.disconnect()];
  return () => stops.forEach((stop) => stop());
}

class Gauge {
  isSeen = true;
  #drawnFace = '';

  /** @param {HTMLElement} root @param {import('../core/store.js').Store} store */
  constructor(root, store) {
    this.root = root;
    this.store = store;
    this.parts = build(root);
  }

  /** The ends of both scales, and the speed limit. @returns {Scale} */
  #scale() {
    return {
      speed_max_mps: this.store.limit('gauge.speed_max_mps') ?? 15,
      acceleration_max_mps2: this.store.limit('gauge.acceleration_max_mps2') ?? 3,
      limit_mps: this.store.limit('speed_limit.max_mps'),
    };
  }

  /** Draws what stands still, when the scale or the unit changed. */
  #drawFace() {
    const scale = this.#scale();
    const key = JSON.stringify([scale, speedUnit()]);
    if (key === this.#drawnFace) return;
    showFace(this.parts, scale);
    this.#drawnFace = key;
  }

  /** Rotates what moves, with each frame. */
  move() {
    if (!this.isSeen) return; // six moving layers out of sight cost as much as all the rest
    this.#drawFace();
    const { store } = this;
    const { pointer, white, turn, red, faster, slower } = this.parts;
    const scale = this.#scale();
    const limit = scale.limit_mps === null ? 180 : speedAngle(scale.limit_mps, scale.speed_max_mps);
    const angle = speedAngle(number(store.signal('speed')?.value?.speed_mps) ?? 0, scale.speed_max_mps);
    rotate(pointer, angle);
    rotate(white, Math.min(angle, limit));
    rotate(turn, limit);
    rotate(red, Math.max(0, angle - limit));
    const push = accelerationAngle(number(store.signal('acceleration')?.value?.acceleration_mps2) ?? 0, scale.acceleration_max_mps2);
    rotate(faster, Math.max(0, push));
    rotate(slower, Math.min(0, push));
  }

  /** Writes what is read, five times a second. */
  draw() {
    this.#drawFace();
    const { root, store } = this;
    const { speed, box, struck, unit, note, why, speedMeter } = this.parts;
    const scale = this.#scale();
    const speedInk = store.ink('speed');
    const speed_mps = number(store.signal('speed')?.value?.speed_mps);
    const isSpeedKnown = speed_mps !== null && !isAbsent(speedInk.ink);
    setAttribute(root, 'data-speed', isSpeedKnown ? speedInk.ink : 'never');
    const [digits, unitWord] = isSpeedKnown ? speedWords(speed_mps) : ['–', speedUnit()];
    const block = digitsBox(digits);
    const isOver = isSpeedKnown && speedInk.ink !== 'stale' && scale.limit_mps !== null && Math.abs(speed_mps) > scale.limit_mps;
    setText(speed, digits);
    setAttribute(speed, 'data-size', block.size);
    setAttribute(root, 'data-over', isOver);
    for (const part of [box, struck]) {
      setAttribute(part, 'x', block.x);
      setAttribute(part, 'width', block.width);
    }
    // The dotted line and the age stand beneath the digits, within the red block.
    const isAged = speedInk.ink === 'ageing' && isSpeedKnown;
    setAttribute(speed, 'y', isAged ? 223 : 231);
    setAttribute(box, 'y', isAged ? 138 : 146);
    setAttribute(box, 'height', isAged ? 114 : 98);
    const isBack = isSpeedKnown && speed_mps < 0 && digits.startsWith('−');
    setAttribute(unit, 'x', block.unitX);
    setText(unit, isSpeedKnown ? (isBack ? `${unitWord} back` : unitWord) : '');
    const source = noteOf(speedInk, isSpeedKnown);
    setText(note, source);
    const text = [source, ...this.#drawWay(speedInk.ink)].filter(Boolean).join(', ');
    show(why, text !== '');
    setAttribute(why, 'aria-label', `Speed: ${text}. Show its source`);
    const isSpeedNow = isSpeedKnown && speedInk.ink !== 'stale';
    const isOrdered = this.#drawOrder(isSpeedNow ? speed_mps : null, scale);
    meter(speedMeter, isSpeedNow ? Math.abs(speedIn(speed_mps)) : null, speedIn(scale.speed_max_mps), `${digits} ${spokenSpeedUnit()}${isOrdered}`);
    this.#drawAcceleration(scale);
  }

  /** Writes how far the car may have driven since, and the speed that a late link allows; returns both. @param {import('../core/ink.js').Freshness} ink of the speed */
  #drawWay(ink) {
    const { unseen, keeps, keptWay } = this.parts;
    const metres = unseenOf(this.store);
    const way = ink !== 'ageing' && ink !== 'stale' ? '' : metres === null ? 'driven: unknown' : unseenWords(metres); // short: it stands within the arc
    const [speed = '', of = ''] = proposalOf(this.store);
    setText(unseen, way);
    setText(keeps, speed);
    setText(keptWay, of);
    return [way, `${speed} ${of}`.trim()];
  }

  /** @param {Scale} scale */
  #drawAcceleration(scale) {
    const { root, store } = this;
    const { acceleration, accelerationUnit, accelerationMeter } = this.parts;
    const pushInk = store.ink('acceleration');
    const push = number(store.signal('acceleration')?.value?.acceleration_mps2);
    const isPushKnown = push !== null && !isAbsent(pushInk.ink);
    setAttribute(root, 'data-push', isPushKnown ? pushInk.ink : 'never');
    const why = isAbsent(pushInk.ink) ? ABSENT[pushInk.ink] : 'unknown';
    setAttribute(need(root, '.aval'), 'data-none', !isPushKnown);
    setText(acceleration, isPushKnown ? signed(push) : 'acceleration –'); // by name: it stands right above the speed
    setText(accelerationUnit, isPushKnown ? 'm/s²' : '');
    setAttribute(accelerationMeter, 'aria-valuemin', -scale.acceleration_max_mps2);
    meter(accelerationMeter, isPushKnown && pushInk.ink !== 'stale' ? push : null, scale.acceleration_max_mps2, `${signed(push)} metres per second squared`, why);
  }

  /** Draws the speed of a slow-down order; returns its text for the meter. @param {number | null} speed_mps @param {Scale} scale */
  #drawOrder(speed_mps, { speed_max_mps, limit_mps }) {
    const { arc, order, ordered } = this.parts;
    const ordered_mps = number(this.store.isSilent ? null : orderOf(this.store.frame?.decelerate)?.ordered_mps);
    for (const part of [arc, order]) show(part, ordered_mps !== null);
    if (ordered_mps === null) return '';
    const mark = orderMark(ordered_mps, speed_mps, speed_max_mps, limit_mps);
    setAttribute(arc, 'd', mark.d);
    for (const [name, value] of /** @type {const} */ ([['x', mark.x], ['y', mark.y], ['text-anchor', mark.anchor]])) setAttribute(order, name, value);
    const [text] = speedWords(ordered_mps);
    setText(ordered, text);
    return `, ordered ${text}`;
  }
}

/** Builds the parts of the gauge in `root`. @param {HTMLElement} root */
function build(root) {
  const face = svg('svg', { viewBox: VIEW, 'aria-hidden': 'true' });
  // What moves has layers of its own that the compositor rotates: no path is drawn again while the car drives.
  const white = sweep(172, 188, 180);
  const red = sweep(172, 188, 180, 'over');
  const turn = html('div', { class: 'turn' }, red);
  const faster = sweep(115, 125, -90);
  const slower = sweep(115, 125, 90);
  const pointer = svg('svg', { viewBox: VIEW, class: 'moves', 'aria-hidden': 'true' }, svg('path', { class: 'ptr', d: 'M40 214L-2 214' }));
  const bug = svg('g');
  const acceleration = svg('tspan', { class: 'num' });
  const accelerationUnit = svg('tspan', { class: 'unit', 'font-size': 15, dx: 5 }, 'm/s²');
  const box = svg('rect', { class: 'box' });
  const speed = svg('text', { class: 'speed', x: 190, 'text-anchor': 'middle' });
  const struck = svg('rect', { class: 'struck', y: 146, height: 90 });
  const unit = svg('text', { class: 'unit', y: 240 });
  const note = svg('text', { class: 'note', x: 190, y: 249, 'text-anchor': 'middle' });
  const unseen = svg('text', { class: 'way', x: 190, y: 138, 'text-anchor': 'middle', 'data-f': 'unseen' });
  const [keeps, keptWay] = [232, 248].map((y) => svg('text', { class: 'way', x: 0, y }));
  const arc = svg('path', { class: 'ordarc' });
  const ordered = svg('tspan', { class: 'num' });
  const order = svg('text', { class: 'ord' }, 'ordered ', ordered);
  const top = svg('svg', { viewBox: VIEW, 'aria-hidden': 'true' }, bug, arc, order,
    svg('text', { class: 'aval', x: 190, y: 121, 'text-anchor': 'middle' }, acceleration, accelerationUnit), box, speed, struck, unit, note, unseen, keeps, keptWay);
  const speedMeter = html('div', { class: 'unseen', role: 'meter', 'aria-label': 'Speed', 'aria-valuemin': 0 });
  const why = html('button', { type: 'button', class: 'why', 'data-age-of': 'speed', hidden: true });
  const accelerationMeter = html('div', { class: 'unseen', role: 'meter', 'aria-label': 'Acceleration' });
  root.replaceChildren(
    face, html('div', { class: 'clip' }, white), html('div', { class: 'clip' }, turn), html('div', { class: 'clip right' }, faster),
    html('div', { class: 'clip left' }, slower), pointer, top, speedMeter, accelerationMeter, why,
  );
  return { face, white, red, turn, faster, slower, pointer, bug, acceleration, accelerationUnit, box, speed, struck, unit, note, unseen, keeps, keptWay, why, arc, ordered, order, speedMeter, accelerationMeter };
}

/**
 * Draws tracks, ticks, labels and the mark of the limit.
 * @param {ReturnType<typeof build>} parts
 * @param {Scale} scale
 */
function showFace({ face, bug }, scale) {
  const { tracks, rungs, ticks, labels, limit } = faceOf({
    speed_max: speedIn(scale.speed_max_mps), acceleration_max_mps2: scale.acceleration_max_mps2, limit: speedIn(scale.limit_mps),
  });
  face.replaceChildren(
    svg('path', { class: 'track', d: tracks.join('') }), // as one: the browser pays for each path, not for its length
    svg('path', { class: 'rung', d: rungs.join('') }),
    ...[false, true].map((isBig) => svg('path', { class: isBig ? 'tick big' : 'tick', d: ticks.filter((tick) => tick.isBig === isBig).map(({ d }) => d).join('') })),
    ...labels.map(({ text, x, y }) => svg('text', { class: /[+−]/.test(text) ? 'num end' : 'num', x, y, 'text-anchor': 'middle' }, text)),
  );
  bug.replaceChildren(...(limit ? [
    svg('path', { class: 'bugline', d: limit.line }), svg('path', { class: 'bug', d: limit.wedge }),
    svg('text', { class: 'lim', x: limit.x, y: limit.y, 'text-anchor': limit.anchor }, 'limit ', svg('tspan', { class: 'num' }, limit.text)),
  ] : []));
}

/**
 * @param {{ink: import('../core/freshness.js').Ink, age_s: number | null}} state
 * @param {boolean} isKnown
 */
function noteOf({ ink, age_s }, isKnown) {
  if (isAbsent(ink)) return ABSENT[ink];
  if (ink === 'stale') return `STALE ${age(age_s)} s`;
  if (!isKnown) return 'unknown';
  return ink === 'ageing' ? `${age(age_s)} s old` : '';
}

/**
 * A half ring that is turned into sight from behind the edge of its clip.
 * @param {number} inner
 * @param {number} outer
 * @param {number} from degrees where it begins when nothing of it is seen
 * @param {string} [kind]
 */
function sweep(inner, outer, from, kind = '') {
  return svg('svg', { viewBox: VIEW, class: `moves ${kind}`.trim(), 'aria-hidden': 'true' }, svg('path', { class: 'val', d: band(inner, outer, from, from + 180) }));
}

/** A turn that is smaller than the width of the pointer is put there without a transition: it looks the same and halves the cost of Home [degrees]. */
const PUT_DEG = 1.5;
/** @type {WeakMap<Element, number>} */
const turned = new WeakMap();

/**
 * @param {HTMLElement | SVGElement} element
 * @param {number} degrees
 */
function rotate(element, degrees) {
  const before = turned.get(element);
  if (before !== undefined && Math.abs(degrees - before) < 0.1) return;
  turned.set(element, degrees);
  const duration = before === undefined || Math.abs(degrees - before) < PUT_DEG ? '0s' : '';
  if (element.style.transitionDuration !== duration) element.style.transitionDuration = duration;
  element.style.transform = `rotate(${degrees.toFixed(1)}deg)`;
}

/**
 * @param {HTMLElement} element
 * @param {number | null} value null: unknown
 * @param {number} max
 * @param {string} text
 * @param {string} [unknown] where it is
 */
function meter(element, value, max, text, unknown = 'unknown') {
  setAttribute(element, 'aria-valuemax', Number(max.toFixed(1)));
  setAttribute(element, 'aria-valuenow', (value ?? 0).toFixed(1));
  setAttribute(element, 'aria-valuetext', value === null ? unknown : text);
}

/**
 * @param {unknown} value
 * @returns {number | null}
 */
function number(value) {
  return typeof value === 'number' && Number.isFinite(value) ? value : null;
}
