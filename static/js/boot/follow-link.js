// The address of the page may lead on: to a page that a link in a mail names, or to a moment of a recording.

import { thenOf } from './pairing-token.js';

/** Whether the address names a tab, before the page writes its own there. */
const namesTab = location.hash.length > 1;

/** Follows the address once this device is connected. @param {import('../core/store.js').Store} store @param {ReturnType<typeof import('../shell/notice.js').notices>} say */
export function followLink(store, say) {
  const query = new URLSearchParams(location.search);
  const then = thenOf(query.get('then'));
  const recording = query.get('replay');
  let isFollowed = false;
  store.sync.whenOpen(() => {
    if (isFollowed) return;
    isFollowed = true;
    if (query.has('then')) history.replaceState(history.state, '', location.pathname);
    if (then) location.assign(then);
    if (recording) import('../replay/replay.js').then(({ openReplay }) => openReplay(recording, store, say, { at_s: Number(query.get('t')) || 0, staysOnTab: namesTab })).catch(() => say('The replay could not be loaded.', 'Not replayed'));
  });
}
