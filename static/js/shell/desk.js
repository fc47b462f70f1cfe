// What only a wide window or a keyboard uses, fetched as one script once the first values stand.

import { styled } from '../core/style-sheet.js';
import { mount as mountKeys } from './keys.js';
import { mount as mountPanes } from './panes.js';

/**
 * @param {HTMLElement} monitor
 * @param {import('../core/store.js').Store} store
 * @param {import('./tabs.js').Tabs} tabs
 * @param {(sentence: string, title?: string) => void} say
 */
export function mount(monitor, store, tabs, say) {
  const wall = matchMedia('(min-width: 1800px)'); // as in wall.css
  const dress = () => wall.matches && styled('wall');
  void dress();
  wall.addEventListener('change', dress);
  mountPanes(monitor, store);
  mountKeys(monitor, store, tabs, say);
}
