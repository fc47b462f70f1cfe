// Hands on the map: one finger pulls it where it is free, two make it larger, a wheel and keys do the same. Elsewhere one
// finger is left to the browser, which changes tabs and scrolls with it.

import { listen } from '../core/dom.js';

/**
 * @typedef {object} Hands
 * @property {() => boolean} isFree whether one finger pulls the map
 * @property {(dx: number, dy: number) => void} pan [px]
 * @property {(factor: number, dx: number, dy: number) => void} zoom about a point right of and below the middle [px]
 */

const STEP_PX = 80;
const WHEEL = 0.0022; // a notch of a wheel is about 100 px: a quarter larger
const PINCH = 0.01; // a trackpad's pinch comes as a wheel of few pixels

/**
 * @param {HTMLElement} box
 * @param {Hands} hands
 */
export function mountGestures(box, { isFree, pan, zoom }) {
  /** @type {{x: number, y: number, apart: number, fingers: number} | null} */
  let before = null;

  /** @param {number} x @param {number} y */
  function fromMiddle(x, y) {
    const { left, top, width, height } = box.getBoundingClientRect();
    return /** @type {[number, number]} */ ([x - left - width / 2, y - top - height / 2]);
  }

  /** @param {TouchList} touches */
  function grip(touches) {
    const [a, b] = [touches[0], touches[1]];
    if (!a) return null;
    if (!b) return { x: a.clientX, y: a.clientY, apart: 0, fingers: 1 };
    return { x: (a.clientX + b.clientX) / 2, y: (a.clientY + b.clientY) / 2, apart: Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY), fingers: touches.length };
  }

  /** @param {TouchEvent} event */
  function touched(event) {
    before = grip(event.targetTouches);
    if (event.targetTouches.length > 1 || isFree()) event.preventDefault();
  }

  /** @param {TouchEvent} event */
  function moved(event) {
    const now = grip(event.targetTouches);
    if (!before || !now || now.fingers !== before.fingers) {
      before = now;
      return;
    }
    if (now.fingers > 1 || isFree()) {
      event.preventDefault();
      if (isFree()) pan(now.x - before.x, now.y - before.y);
      if (now.fingers > 1 && before.apart > 10 && now.apart > 10) zoom(now.apart / before.apart, ...fromMiddle(now.x, now.y));
    }
    before = now;
  }

  /** @param {PointerEvent} event */
  function pressed(event) {
    if (event.pointerType === 'touch' || event.button !== 0 || !isFree()) return;
    box.setPointerCapture(event.pointerId);
  }

  /** @param {PointerEvent} event */
  function pulled(event) {
    if (event.pointerType !== 'touch' && box.hasPointerCapture(event.pointerId)) pan(event.movementX, event.movementY);
  }

  /** @param {WheelEvent} event */
  function wheeled(event) {
    if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) return; // sideways: another tab
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 16 : 1;
    const down = Math.max(-300, Math.min(300, event.deltaY * lines));
    zoom(Math.exp(-down * (event.ctrlKey ? PINCH : WHEEL)), ...fromMiddle(event.clientX, event.clientY));
  }

  /** @param {KeyboardEvent} event */
  function keyed(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target !== box) return;
    const step = /** @type {Record<string, [number, number]>} */ ({ ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] })[event.key];
    if (step && isFree()) pan(step[0] * STEP_PX, step[1] * STEP_PX);
    else if (event.key === '+' || event.key === '=') zoom(1.5, 0, 0);
    else if (event.key === '-') zoom(1 / 1.5, 0, 0);
    else if (!step?.[0]) return; // up and down scroll; sideways would leave for another tab
    event.preventDefault();
  }

  const stops = [
    listen(box, 'touchstart', touched, { passive: false }),
    listen(box, 'touchmove', moved, { passive: false }),
    listen(box, 'touchend', (event) => { before = grip(event.targetTouches); }),
    listen(box, 'touchcancel', () => { before = null; }),
    listen(box, 'pointerdown', pressed),
    listen(box, 'pointermove', pulled),
    listen(box, 'wheel', wheeled, { passive: false }),
    listen(box, 'keydown', keyed),
  ];
  return () => stops.forEach((stop) => stop());
}
