// Gestures on the map: one finger moves it where it is free, two zoom; a mouse, a wheel and keys do the same.
// Elsewhere one finger is left to the browser, which changes tabs and scrolls with it.

import { listen } from '../core/dom.js';

/**
 * @typedef {object} Acts
 * @property {() => boolean} isFree whether one finger moves the map
 * @property {(dx: number, dy: number) => void} pan [px]
 * @property {(factor: number, dx: number, dy: number) => void} zoom about a point right of and below the middle [px]
 */

const STEP_PX = 80;
const KEY_ZOOM = 1.5;
const WHEEL = 0.0022; // a notch of a wheel is about 100 px: a quarter larger
const PINCH = 0.01; // a trackpad reports a pinch as a wheel of few pixels

/**
 * @param {HTMLElement} box
 * @param {Acts} acts
 */
export function mountGestures(box, acts) {
  const stops = [...mountFingers(box, acts), ...mountMouse(box, acts), listen(box, 'keydown', (event) => pressed(event, box, acts))];
  return () => stops.forEach((stop) => stop());
}

/** @param {HTMLElement} box @param {Acts} acts */
function mountFingers(box, { isFree, pan, zoom }) {
  /** @type {ReturnType<typeof gripOf>} */
  let before = null;

  /** @param {TouchEvent} event */
  function touched(event) {
    before = gripOf(event.targetTouches);
    if (event.targetTouches.length > 1 || isFree()) event.preventDefault();
  }

  /** @param {TouchEvent} event */
  function moved(event) {
    const last = before;
    const now = before = gripOf(event.targetTouches);
    if (!last || !now || now.fingers !== last.fingers || (now.fingers === 1 && !isFree())) return;
    event.preventDefault();
    if (isFree()) pan(now.x - last.x, now.y - last.y);
    if (now.fingers > 1 && last.apart > 10 && now.apart > 10) zoom(now.apart / last.apart, ...fromMiddle(box, now.x, now.y));
  }

  return [
    listen(box, 'touchstart', touched, { passive: false }),
    listen(box, 'touchmove', moved, { passive: false }),
    listen(box, 'touchend', (event) => { before = gripOf(event.targetTouches); }),
    listen(box, 'touchcancel', () => { before = null; }),
  ];
}

/** @param {HTMLElement} box @param {Acts} acts */
function mountMouse(box, { isFree, pan, zoom }) {
  return [
    listen(box, 'pointerdown', (/** @type {PointerEvent} */ event) => {
      if (event.pointerType !== 'touch' && event.button === 0 && isFree()) box.setPointerCapture(event.pointerId);
    }),
    listen(box, 'pointermove', (/** @type {PointerEvent} */ event) => {
      if (event.pointerType !== 'touch' && box.hasPointerCapture(event.pointerId)) pan(event.movementX, event.movementY);
    }),
    listen(box, 'wheel', (/** @type {WheelEvent} */ event) => {
      if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) return; // sideways: another tab
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 16 : 1;
      const down = Math.max(-300, Math.min(300, event.deltaY * lines));
      zoom(Math.exp(-down * (event.ctrlKey ? PINCH : WHEEL)), ...fromMiddle(box, event.clientX, event.clientY));
    }, { passive: false }),
  ];
}

/** @param {KeyboardEvent} event @param {HTMLElement} box @param {Acts} acts */
function pressed(event, box, { isFree, pan, zoom }) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target !== box) return;
  const step = /** @type {Record<string, [number, number]>} */ ({ ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] })[event.key];
  if (step && isFree()) pan(step[0] * STEP_PX, step[1] * STEP_PX);
  else if (event.key === '+' || event.key === '=') zoom(KEY_ZOOM, 0, 0);
  else if (event.key === '-') zoom(1 / KEY_ZOOM, 0, 0);
  else if (!step?.[0]) return; // up and down scroll; sideways would leave for another tab
  event.preventDefault();
}

/** Where the fingers are: the middle of two, and their distance. @param {TouchList} touches */
function gripOf(touches) {
  const [a, b] = [touches[0], touches[1]];
  if (!a) return null;
  if (!b) return { x: a.clientX, y: a.clientY, apart: 0, fingers: 1 };
  return { x: (a.clientX + b.clientX) / 2, y: (a.clientY + b.clientY) / 2, apart: Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY), fingers: touches.length };
}

/** @param {HTMLElement} box @param {number} x @param {number} y @returns {[number, number]} */
function fromMiddle(box, x, y) {
  const { left, top, width, height } = box.getBoundingClientRect();
  return [x - left - width / 2, y - top - height / 2];
}
