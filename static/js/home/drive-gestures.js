// Fingers, mouse, wheel and keys on the chart of a drive: one finger moves or reads, two zoom; so do wheel and keys.

import { listen } from '../core/dom.js';

/** A finger that moves less than this taps [px]. */
const TAP_PX = 8;
const WHEEL = 0.0015; // of zoom a pixel of the wheel

/**
 * @typedef {{zoom?: number, pan?: number, about?: number}} Change
 *
 * @typedef {object} Target
 * @property {() => DOMRect} box the drawing area
 * @property {(change: Change) => void} change
 * @property {(share: number) => void} read 0 … 1 of the width
 * @property {(share: number | null) => void} hover null: the mouse left
 * @property {(key: string) => boolean} key whether it was one of the chart's
 */

/**
 * @param {HTMLElement} host
 * @param {Target} target
 * @returns {() => void}
 */
export function mountGestures(host, target) {
  /** The horizontal position of each finger [px]. @type {Map<number, number>} */
  const down = new Map();
  let moved_px = 0;
  const share = (/** @type {number} */ x) => (x - target.box().left) / (target.box().width || 1);
  const move = (/** @type {PointerEvent} */ event) => {
    const before = down.get(event.pointerId);
    if (before === undefined) return;
    const [other] = [...down].filter(([id]) => id !== event.pointerId).map(([, x]) => x);
    down.set(event.pointerId, event.clientX);
    moved_px += Math.abs(event.clientX - before);
    if (other !== undefined) {
      const about = Math.max(0, Math.min(1, share((other + event.clientX) / 2)));
      target.change({ zoom: Math.max(20, Math.abs(before - other)) / Math.max(20, Math.abs(event.clientX - other)), about });
    } else if (moved_px >= TAP_PX) target.change({ pan: (before - event.clientX) / (target.box().width || 1) });
  };
  const stops = [
    listen(host, 'pointerdown', (event) => {
      down.set(event.pointerId, event.clientX);
      moved_px = down.size > 1 ? TAP_PX : 0;
      host.setPointerCapture(event.pointerId);
    }),
    listen(host, 'pointermove', (event) => {
      if (down.size) move(event);
      else if (event.pointerType === 'mouse') target.hover(share(event.clientX));
    }),
    listen(host, 'pointerup', (event) => {
      if (down.delete(event.pointerId) && moved_px < TAP_PX) target.read(share(event.clientX));
    }),
    listen(host, 'pointercancel', (event) => down.delete(event.pointerId)),
    listen(host, 'pointerleave', () => target.hover(null)),
    listen(host, 'wheel', (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 16 : 1; // some mice count lines
      if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) target.change({ pan: ((event.deltaX || event.deltaY) * lines) / (target.box().width || 1) });
      else target.change({ zoom: Math.exp(event.deltaY * lines * WHEEL), about: Math.max(0, Math.min(1, share(event.clientX))) });
    }, { passive: false }),
    listen(host, 'keydown', (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || !target.key(event.key)) return;
      event.preventDefault();
      event.stopPropagation();
    }),
  ];
  return () => stops.forEach((stop) => stop());
}
