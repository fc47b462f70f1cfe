// The gauge: speed over 180°, acceleration within, the operator's limit at the edge.

import { html, setAttribute, setText, show, svg } from './dom.js';
import { accelerationAngle, band, digitsBox, faceOf, orderMark, speedAngle } from './gauge-layout.js';
import { ABSENT } from './ink.js';
import { orderOf } from './slow-layout.js';
import { speedIn, speedUnit, speedWords, spokenSpeedUnit } from './units.js';
import { age, signed } from './words.js';

const VIEW = '0 0 380 250';

/**
 * @param {HTMLElement} root
 * @param {import('./store.js').Store} store
 * @returns {() => void}
 */
export function mount(root, store) {
  const face = svg('svg', { viewBox: VIEW, 'aria-hidden': 'true' });
  // What moves lies in layers of its own and is turned by the compositor: no path is drawn anew while the car drives.
  const white = sweep(172, 188, 180);
  const red = sweep(172, 188, 180, 'over');
  const turn = html('div', { class: 'turn' }, red);
  const faster = sweep(115, 125, -90);
  const slower = sweep(115, 125, 90);
  const pointer = svg('svg', { viewBox: VIEW, class: 'moves', 'aria-hidden': 'true' }, svg('path', { class: 'ptr', d: 'M40 214L-2 214' }));
  const bug = svg('g');
  const acceleration = svg('tspan', { class: 'num' });
  const accelerationUnit = svg('tspan', { class: 'unit', 'font-size': 15, dx: 5 }, 'm/s²');
  const box = svg('rect', { class: 'box', y: 146, height: 98 });
  const speed = svg('text', { class: 'speed', x: 190, y: 231, 'text-anchor': 'middle' });
  const struck = svg('rect', { class: 'struck', y: 146, height: 90 });
  const unit = svg('text', { class: 'unit', y: 240 });
  const note = svg('text', { class: 'note', x: 190, y: 249, 'text-anchor': 'middle' });
  const arc = svg('path', { class: 'ordarc' });
  const ordered = svg('tspan', { class: 'num' });
  const order = svg('text', { class: 'ord' }, 'ordered ', ordered);
  const top = svg('svg', { viewBox: VIEW, 'aria-hidden': 'true' }, bug, arc, order,
    svg('text', { class: 'aval', x: 190, y: 124, 'text-anchor': 'middle' }, acceleration, accelerationUnit), box, speed, struck, unit, note);
  const speedMeter = html('div', { class: 'unseen', role: 'meter', 'aria-label': 'Speed', 'aria-valuemin': 0 });
  const accelerationMeter = html('div', { class: 'unseen', role: 'meter', 'aria-label': 'Acceleration' });
  root.replaceChildren(
    face, html('div', { class: 'clip' }, white), html('div', { class: 'clip' }, turn), html('div', { class: 'clip right' }, faster),
    html('div', { class: 'clip left' }, slower), pointer, top, speedMeter, accelerationMeter,
  );
  let drawnFace = '';
  let isSeen = true;

  function scaleOf() {
    return {
      speed_max_mps: store.limit('gauge.speed_max_mps') ?? 15,
      acceleration_max_mps2: store.limit('gauge.acceleration_max_mps2') ?? 3,
      limit_mps: store.limit('speed_limit.max_mps'),
    };
  }

  function drawFace() {
    const scale = scaleOf();
    const key = JSON.stringify([scale, speedUnit()]);
    if (key === drawnFace) return;
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
    drawnFace = key;
  }

  // Each frame: what moves.
  function move() {
    if (!isSeen) return; // six layers on their way to where nobody looks cost as much as all the rest
    drawFace();
    const scale = scaleOf();
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

  // Five times a second: what is read.
  function draw() {
    drawFace();
    const scale = scaleOf();
    const speedInk = store.ink('speed');
    const speed_mps = number(store.signal('speed')?.value?.speed_mps);
    const isSpeedKnown = speed_mps !== null && isValue(speedInk.ink);
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
    const isBack = isSpeedKnown && speed_mps < 0 && digits.startsWith('−');
    setAttribute(unit, 'x', block.unitX);
    setText(unit, isSpeedKnown ? (isBack ? `${unitWord} back` : unitWord) : '');
    setText(note, noteOf(speedInk, isSpeedKnown));
    const isSpeedNow = isSpeedKnown && speedInk.ink !== 'stale';
    const isOrdered = drawOrder(isSpeedNow ? speed_mps : null, scale);
    meter(speedMeter, isSpeedNow ? Math.abs(speedIn(speed_mps)) : null, speedIn(scale.speed_max_mps), `${digits} ${spokenSpeedUnit()}${isOrdered}`);

    const pushInk = store.ink('acceleration');
    const push = number(store.signal('acceleration')?.value?.acceleration_mps2);
    const isPushKnown = push !== null && isValue(pushInk.ink);
    setAttribute(root, 'data-push', isPushKnown ? pushInk.ink : 'never');
    setText(acceleration, isPushKnown ? signed(push) : pushInk.ink === 'not_published' ? 'not published' : '–');
    setText(accelerationUnit, isPushKnown || pushInk.ink !== 'not_published' ? 'm/s²' : '');
    setAttribute(accelerationMeter, 'aria-valuemin', -scale.acceleration_max_mps2);
    meter(accelerationMeter, isPushKnown && pushInk.ink !== 'stale' ? push : null, scale.acceleration_max_mps2, `${signed(push)} metres per second squared`);
  }

  /** What the car was ordered, beside what it does. @param {number | null} speed_mps @param {ReturnType<typeof scaleOf>} scale */
  function drawOrder(speed_mps, { speed_max_mps, limit_mps }) {
    const ordered_mps = number(store.isSilent ? null : orderOf(store.frame?.decelerate)?.ordered_mps);
    for (const part of [arc, order]) show(part, ordered_mps !== null);
    if (ordered_mps === null) return '';
    const mark = orderMark(ordered_mps, speed_mps, speed_max_mps, limit_mps);
    setAttribute(arc, 'd', mark.d);
    for (const [name, value] of /** @type {const} */ ([['x', mark.x], ['y', mark.y], ['text-anchor', mark.anchor]])) setAttribute(order, name, value);
    const [words] = speedWords(ordered_mps);
    setText(ordered, words);
    return `, ordered ${words}`;
  }

  move();
  if (store.frame) draw(); // before the first frame it is not shown
  const watcher = new IntersectionObserver((entries) => {
    isSeen = entries.at(-1)?.isIntersecting ?? true;
    move();
  });
  watcher.observe(root);
  const stops = [store.on('move', move), store.on('draw', draw), () => watcher.disconnect()];
  return () => stops.forEach((stop) => stop());
}

/** @param {import('./protocol.js').Freshness} ink */
const isValue = (ink) => ink !== 'never' && ink !== 'not_published';

/**
 * @param {{ink: import('./protocol.js').Freshness, age_s: number | null}} state
 * @param {boolean} isKnown
 */
function noteOf({ ink, age_s }, isKnown) {
  if (ink === 'never' || ink === 'not_published') return ABSENT[ink];
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

/** A turn smaller than the pointer is wide is put, not moved: it looks the same, and is half of what Home costs [degrees]. */
const PUT_DEG = 1;
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
 */
function meter(element, value, max, text) {
  setAttribute(element, 'aria-valuemax', Number(max.toFixed(1)));
  setAttribute(element, 'aria-valuenow', (value ?? 0).toFixed(1));
  setAttribute(element, 'aria-valuetext', value === null ? 'unknown' : text);
}

/**
 * @param {unknown} value
 * @returns {number | null}
 */
function number(value) {
  return typeof value === 'number' && Number.isFinite(value) ? value : null;
}
