// The one line under the tabs that never moves: the worst of what stands.

import { stripOf } from '../alarms/alarm-layout.js';
import { hasAged, whyUnchecked } from '../alarms/checks.js';
import { field, need, setAttribute, setIcon, setSentence } from '../core/dom.js';

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const strip = field(root, 'strip');
  const mark = need(strip, '.i');
  const text = field(root, 'strip-text');
  const end = field(root, 'strip-end');
  const frame = need(document, '.frame');

  function draw() {
    const { frame: of } = store;
    const seen = stripOf(of, {
      stale: Object.keys(of?.signals ?? {}).filter((name) => store.ink(name).ink === 'stale').length,
      unchecked: whyUnchecked(store) !== null ? 'all' : hasAged(store) ? 'ok' : null, isSilent: store.isSilent, chain: store.chain,
      paused_s: (of?.session.paused_for_s ?? 0) + store.lag_s,
    });
    setAttribute(strip, 'data-kind', seen.kind || null);
    setAttribute(strip, 'data-returned', seen.hasReturned);
    setAttribute(strip, 'data-known', seen.isKnown);
    setAttribute(strip, 'data-opens', seen.opens);
    setAttribute(strip, 'data-unconfirmed', seen.isUnconfirmed);
    setIcon(mark, seen.icon);
    setSentence(text, seen.text);
    setSentence(end, seen.end);
    const mode = modeOf(store);
    setAttribute(frame, 'data-mode', mode);
    setAttribute(document.documentElement, 'data-framed', mode !== 'none');
  }

  if (store.frame) draw(); // before the first frame it is not shown
  return store.on('draw', draw);
}

/**
 * The edge of the screen tells the mode.
 * @param {import('../core/store.js').Store} store
 */
function modeOf(store) {
  const frame = store.heeded;
  if (!frame || !store.isMonitoring) return 'none';
  if (frame.session.paused && !store.isSilent) return 'paused';
  if (store.chain.state === 'Lost' && store.silence_s > 2) return 'critical';
  const critical = frame.alarms.filter((alarm) => alarm.priority === 'critical' && alarm.active && alarm.state !== 'SHELVED');
  if (!critical.length || store.isSilent) return 'none';
  return critical.some((alarm) => alarm.state === 'UNACKED') ? 'asking' : 'critical';
}
