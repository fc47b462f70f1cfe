// Fingers on the chart: one reads a moment or moves the zoomed view, two zoom.

import { listen } from '../core/dom.js';

/** A finger that moves less than this taps [px]. */
const TAP_PX = 8;

/**
 * @param {HTMLElement} host
 * @param {() => import('../../vendor/uPlot.esm.js')} plotOf
 * @param {{change: (change: {pan?: number, zoom?: number, about?: number}) => void, read: (at_s: number) => void}} chart
 * @returns {() => void}
 */
export function mountFingers(host, plotOf, { change, read }) {
  /** @type {Map<number, number>} the horizontal position of each finger [px] */
  const down = new Map();
  let moved_px = 0;
  const plotBox = () => plotOf().over.getBoundingClientRect();
  const stops = [
    listen(host, 'pointerdown', (event) => {
      if (!plotOf().over.contains(event.target)) return;
      down.set(event.pointerId, event.clientX);
      moved_px = down.size > 1 ? TAP_PX : 0;
      host.setPointerCapture(event.pointerId);
    }),
    listen(host, 'pointermove', (event) => {
      const before = down.get(event.pointerId);
      if (before === undefined) return;
      const [other] = [...down].filter(([id]) => id !== event.pointerId).map(([, x]) => x);
      down.set(event.pointerId, event.clientX);
      moved_px += Math.abs(event.clientX - before);
      const { left, width } = plotBox();
      if (other !== undefined) {
        const about = Math.max(0, Math.min(1, ((other + event.clientX) / 2 - left) / (width || 1)));
        change({ zoom: Math.max(20, Math.abs(before - other)) / Math.max(20, Math.abs(event.clientX - other)), about });
      } else if (moved_px >= TAP_PX) change({ pan: (before - event.clientX) / (width || 1) });
    }),
    listen(host, 'pointerup', (event) => {
      if (down.delete(event.pointerId) && moved_px < TAP_PX) read(plotOf().posToVal(event.clientX - plotBox().left, 'x'));
    }),
    listen(host, 'pointercancel', (event) => down.delete(event.pointerId)),
  ];
  return () => stops.forEach((stop) => stop());
}
