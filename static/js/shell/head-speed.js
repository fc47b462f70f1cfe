// What covers the gauge carries the speed in its head.

import { html, show } from '../core/dom.js';
import { write } from '../core/ink.js';
import { speedUnit, speedWords } from '../core/units.js';

/**
 * The car's speed at the end of a title bar, until it is stopped: of a car of now, never of a recording. Covered like the gauge where it is not renewed.
 * @param {Element} bar
 * @param {import('../core/store.js').Store} store
 * @returns {() => void}
 */
export function mountHeadSpeed(bar, store) {
  const value = html('span', { class: 'n v' });
  const unit = html('span', { class: 'u' });
  const speed = html('p', { class: 'head-speed', role: 'group', 'aria-label': 'Speed' }, value, unit, html('span', { class: 'cover' }));
  bar.append(speed);
  const draw = () => {
    show(speed, !store.frame?.replay);
    const speed_mps = store.signal('speed')?.value?.speed_mps;
    const isKnown = typeof speed_mps === 'number';
    write(value, store.ink('speed').ink, isKnown ? speedWords(speed_mps)[0] ?? '–' : '–', unit, isKnown ? speedUnit() : '');
  };
  draw();
  const off = store.on('draw', draw);
  return () => {
    off();
    speed.remove();
  };
}
