// What fills each tab when it first comes to the front; the tabs themselves are declared in server/web/tabs.py.

import { need } from '../core/dom.js';
import { fetchStyle } from '../core/style-sheet.js';
import { LazyTab } from './lazy-tab.js';

/**
 * @typedef {object} TabPage what a tab is given
 * @property {import('../core/store.js').Store} store
 * @property {ReturnType<typeof import('./notice.js').notices>} say
 * @property {() => boolean} isFront whether any of the tab can be seen now
 *
 * @typedef {object} TabModule
 * @property {(panel: HTMLElement, page: TabPage) => import('./lazy-tab.js').Content} mount
 *
 * @typedef {object} Row
 * @property {() => Promise<TabModule>} fetch
 * @property {string} [state] the field that shows that it could not be fetched, where it is not NAME-state
 * @property {boolean} [isNear] fetch it as soon as an edge of it is seen, for example in a swipe
 */

/** Home is part of the page itself. Without its sheet the map would draw an old position as a new one. @type {Record<string, Row>} */
const CONTENTS = {
  map: { fetch: async () => (await Promise.all([import('../map/map.js'), fetchStyle('/static/css/map-drawn.css')]))[0], state: 'none-words', isNear: true },
  scan: { fetch: () => import('../scan/scan.js'), state: 'none-words' },
  files: { fetch: () => import('../files/files.js') },
  settings: { fetch: () => import('../settings/settings.js') },
};

/**
 * @param {HTMLElement} monitor
 * @param {TabPage['store']} store
 * @param {TabPage['say']} say
 * @param {(name: string) => boolean} isFront
 */
export function tabContents(monitor, store, say, isFront) {
  return Object.entries(CONTENTS).map(([name, { fetch, state, isNear }]) => {
    const panel = need(monitor, `[data-panel="${name}"]`);
    const page = { store, say, isFront: () => isFront(name) };
    return new LazyTab(panel, {
      what: panel.dataset['what'] ?? name, state: state ?? `${name}-state`, isShown: page.isFront, isNear, fetch,
      mount: ({ mount }) => mount(panel, page),
    });
  });
}
