// The chart of the drive as a screen: it covers the gauge, so the speed stands in the title bar.

import { html, need } from '../core/dom.js';
import { write } from '../core/ink.js';
import { speedUnit, speedWords } from '../core/units.js';
import { mount as mountChart } from './drive-chart.js';

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @returns {() => void}
 */
export function mount(root, store) {
  const value = html('span', { class: 'n v' });
  const unit = html('span', { class: 'u' });
  const speed = html('p', { class: 'trends-speed', 'aria-label': 'Speed' }, value, unit);
  need(document, '#monitor .titlebar').append(speed);
  root.classList.add('trends-screen');
  const draw = () => {
    const speed_mps = store.signal('speed')?.value?.speed_mps;
    const isKnown = typeof speed_mps === 'number';
    write(value, store.ink('speed').ink, isKnown ? speedWords(speed_mps)[0] ?? '–' : '–', unit, isKnown ? speedUnit() : '');
  };
  draw();
  const stops = [store.on('draw', draw), mountChart(root, { store, say: (sentence) => console.warn(sentence) })];
  return () => {
    stops.forEach((stop) => stop());
    speed.remove();
    root.classList.remove('trends-screen');
  };
}
