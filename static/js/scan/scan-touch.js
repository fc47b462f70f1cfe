// Fingers on the plot: two zoom it, one taps a return. A swipe stays the browser's: it changes tabs and scrolls.

import { listen } from '../core/dom.js';

/**
 * @param {HTMLElement} root what is touched
 * @param {object} does
 * @param {() => void} does.grasp two fingers touched
 * @param {(from_px: number, to_px: number) => void} does.pinch how far they were apart, how far they are now
 * @param {(x_px: number, y_px: number) => void} does.tap from the left and upper edge of `root`
 * @param {(sign: 1 | -1) => void} does.wheel a turn of the wheel with Ctrl, as a touch pad pinches
 * @returns {() => void} stops listening
 */
export function mountTouch(root, does) {
  /** @type {number | null} */
  let from_px = null;
  const moved = (/** @type {TouchEvent} */ event) => {
    if (event.touches.length !== 2) return;
    // A scroll that has begun cannot be taken back: it was a swipe, and the fingers must be lifted first.
    if (event.cancelable) event.preventDefault();
    else if (from_px === null) return;
    const now_px = apart(event.touches);
    if (from_px === null) {
      from_px = now_px;
      does.grasp();
    } else does.pinch(from_px, now_px);
  };
  const ended = (/** @type {TouchEvent} */ event) => {
    if (event.touches.length < 2) from_px = null;
  };
  const stops = [
    listen(root, 'touchmove', moved, { passive: false }),
    listen(root, 'touchend', ended),
    listen(root, 'touchcancel', ended),
    listen(root, 'wheel', (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      does.wheel(event.deltaY < 0 ? 1 : -1);
    }, { passive: false }),
    listen(root, 'click', (event) => {
      const box = root.getBoundingClientRect();
      does.tap(event.clientX - box.left, event.clientY - box.top);
    }),
  ];
  // Two fingers that touch at once must not begin a scroll before they have moved.
  stops.push(listen(root, 'touchstart', (event) => {
    if (event.touches.length === 2 && event.cancelable) event.preventDefault();
  }, { passive: false }));
  return () => stops.forEach((stop) => stop());
}

/** @param {TouchList} touches */
function apart(touches) {
  const [a, b] = [touches[0], touches[1]];
  return a && b ? Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) : 0;
}
