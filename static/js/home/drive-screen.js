// The chart of the drive as a screen.

import { mount as mountChart } from './drive-chart.js';

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @param {{say: (sentence: string, title?: string) => void}} screen
 * @returns {() => void}
 */
export function mount(root, store, { say }) {
  root.classList.add('trends-screen');
  const unmount = mountChart(root, { store, say });
  return () => {
    unmount();
    root.classList.remove('trends-screen');
  };
}
