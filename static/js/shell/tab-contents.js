// The tabs whose content is fetched when they first come to the front.

import { need } from '../core/dom.js';
import { LazyTab } from './lazy-tab.js';

/**
 * @param {HTMLElement} monitor
 * @param {import('../core/store.js').Store} store
 * @param {ReturnType<typeof import('./notice.js').notices>} say
 * @param {(name: string) => boolean} isFront
 */
export function tabContents(monitor, store, say, isFront) {
  const panel = (/** @type {string} */ name) => need(monitor, `[data-panel="${name}"]`);
  const shown = (/** @type {string} */ name) => () => isFront(name);
  return [
    new LazyTab(panel('scan'), {
      what: 'The scan', state: 'none-words', isShown: shown('scan'), fetch: () => import('../scan/scan.js'),
      mount: ({ mount }) => {
        const scan = mount(panel('scan'), store);
        const look = () => scan.setFront(isFront('scan')); // sent and drawn only while it is in front
        look();
        return { look };
      },
    }),
    new LazyTab(panel('map'), {
      what: 'The map', state: 'none-words', isShown: shown('map'), isNear: true, fetch: () => import('../map/map.js'),
      mount: ({ mount }) => {
        mount(panel('map'), store, shown('map'), say);
        return {};
      },
    }),
    new LazyTab(panel('files'), {
      what: 'The recordings', state: 'files-state', isShown: shown('files'), fetch: () => import('../files/files.js'),
      mount: ({ mount }) => mount(panel('files'), store, say, shown('files')),
    }),
    new LazyTab(panel('settings'), {
      what: 'The settings', state: 'settings-state', isShown: shown('settings'), fetch: () => import('../settings/settings.js'),
      mount: ({ mount }) => {
        mount(panel('settings'), store, say, shown('settings'));
        return {};
      },
    }),
  ];
}
