// What the browser shows of the page when another one is in front of it: title, icon and, once installed, the app's badge.

import { layOut, titleOf } from '../alarms/alarm-layout.js';
import { need, setAttribute } from '../core/dom.js';

const NAME = 'catgraph';

/** @typedef {{title: string, icon: 'plain' | 'critical' | 'warning' | 'lost' | 'replay', count: number | null}} Badge count: null, a dot */

/**
 * The worst first; what is not live is never called by its last alarm.
 * @param {import('../core/protocol-types.js').State | null} frame
 * @param {{isSilent: boolean, isMonitoring: boolean, state: string}} seen
 * @returns {Badge}
 */
export function badgeOf(frame, { isSilent, isMonitoring, state }) {
  if (!frame || !isMonitoring) return { title: NAME, icon: 'plain', count: 0 };
  if (isSilent || state === 'Lost') return { title: `${isSilent ? 'Not live' : 'Connection lost'} · ${NAME}`, icon: 'lost', count: null };
  const { standing } = layOut((frame.replay ? frame.live?.alarms : frame.alarms) ?? []);
  const urgent = standing.filter((alarm) => alarm.priority !== 'advisory');
  const paused = frame.replay ? 'REPLAY · ' : frame.session.paused ? 'Paused · ' : '';
  if (!urgent[0]) return { title: `${paused}${NAME}`, icon: frame.replay ? 'replay' : 'plain', count: 0 };
  const icon = urgent[0].priority === 'critical' ? 'critical' : 'warning';
  return { title: `(${urgent.length}) ${frame.replay ? 'LIVE ' : ''}${titleOf(urgent[0])} · ${paused}${NAME}`, icon, count: urgent.length };
}

/** @param {import('../core/store.js').Store} store */
export function mount(store) {
  const link = /** @type {HTMLLinkElement} */ (need(document, 'link[rel="icon"]'));
  const icons = { plain: link.getAttribute('href'), critical: link.dataset['critical'], warning: link.dataset['warning'], lost: link.dataset['lost'], replay: link.dataset['replay'] };
  /** @type {number | null | undefined} */
  let shown;

  function draw() {
    const badge = badgeOf(store.frame, { isSilent: store.isSilent, isMonitoring: store.isMonitoring, state: store.chain.state });
    if (document.title !== badge.title && !store.painter.drawing.isFailed) document.title = badge.title; // else undrawn.js writes it
    setAttribute(link, 'href', icons[badge.icon]);
    if (badge.count === shown) return;
    shown = badge.count;
    const done = badge.count === 0 ? navigator.clearAppBadge?.() : navigator.setAppBadge?.(badge.count ?? undefined);
    done?.catch(() => {}); // not installed, or not allowed: there is no badge to set
  }

  draw();
  const stops = [store.on('draw', draw), store.on('tick', () => document.hidden && draw())];
  return () => stops.forEach((stop) => stop());
}
