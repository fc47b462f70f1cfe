// What only a wide window or a keyboard uses, fetched as one script once the first values stand.

import { mount as mountKeys } from './keys.js';
import { mount as mountPanes } from './panes.js';

/**
 * @param {HTMLElement} monitor
 * @param {import('../core/store.js').Store} store
 * @param {import('./tabs.js').Tabs} tabs
 * @param {(sentence: string, title?: string) => void} say
 */
export function mount(monitor, store, tabs, say) {
  mountPanes(monitor, store);
  mountKeys(monitor, store, tabs, say);
}
