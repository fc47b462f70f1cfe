// Brake, accelerator and steering: percent in digits and as bars.

import { field, setAttribute } from '../core/dom.js';
import { isAbsent, write } from '../core/ink.js';
import { fixed } from '../core/format.js';

const HEIGHT = 72, FOOT = 2.5, HALF = 86;

/**
 * A pedal's bar grows upward; 0 keeps a foot, so that an empty bar is seen to be measured.
 * @param {number} percent
 */
export function pedalFill(percent) {
  const height = Math.max(FOOT, (HEIGHT * Math.min(100, Math.max(0, percent))) / 100);
  return { y: HEIGHT - height, height };
}

/**
 * The steering's bar grows from the centre; negative is left.
 * @param {number} percent
 */
export function steeringFill(percent) {
  const width = (HALF * Math.min(100, Math.abs(percent))) / 100;
  return { x: percent < 0 ? HALF - width : HALF, width };
}

/** @param {number} percent */
export function steeringWords(percent) {
  const digits = fixed(Math.abs(percent), 0);
  return { digits, side: digits === '0' ? '% centre' : percent < 0 ? '% left' : '% right' };
}

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const parts = ['brake', 'accelerator', 'steering'].map((name) => {
    const [value, unit, fill, bar] = [name, `${name}-unit`, `${name}-fill`, `${name}-bar`].map((part) => field(root, part));
    if (!value || !unit || !fill || !bar) throw new Error(`The template lacks ${name}`);
    return { name, value, unit, fill, bar };
  });

  function draw() {
    for (const { name, value, unit, fill, bar } of parts) {
      const { ink } = store.ink(name);
      const percent = store.signal(name)?.value?.percent;
      const isKnown = typeof percent === 'number' && !isAbsent(ink);
      const isLive = isKnown && ink !== 'stale';
      const shown = name === 'steering' && isKnown ? steeringWords(percent) : { digits: isKnown ? fixed(percent, 0) : '–', side: '%' };
      write(value, ink, shown.digits, unit, shown.side);
      const shape = name === 'steering' ? steeringFill(isLive ? percent : 0) : pedalFill(isLive ? percent : 0);
      for (const [attribute, size] of Object.entries(shape)) setAttribute(fill, attribute, size.toFixed(1));
      setAttribute(fill, 'data-ink', ink);
      setAttribute(fill, 'hidden', !isLive); // an empty frame is not a measured 0
      setAttribute(bar, 'aria-valuenow', isLive ? Math.round(percent) : 0);
      setAttribute(bar, 'aria-valuetext', isLive ? `${shown.digits} ${shown.side}` : 'unknown');
    }
  }

  // A bar whose foot is out of sight would be read as 0: the digits beside it are whole.
  const watcher = new IntersectionObserver((entries) => {
    for (const { target, intersectionRatio } of entries) /** @type {SVGElement} */ (target).style.opacity = intersectionRatio < 0.98 ? '0' : '';
  }, { threshold: 0.98 });
  for (const { bar } of parts.slice(0, 2)) watcher.observe(bar);
  if (store.frame) draw(); // before the first frame it is not shown
  const stop = store.on('draw', () => store.painter.inTurn(draw));
  return () => [stop(), watcher.disconnect()];
}
