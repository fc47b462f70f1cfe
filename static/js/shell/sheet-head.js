// What a sheet over the values carries in its head: the speed, its age, and the worst alarm.

import { stripOf } from '../alarms/alarm-layout.js';
import { html, icon, need, setAttribute, setIcon, setText, setSentence } from '../core/dom.js';
import { age } from '../core/format.js';
import { mountHeadSpeed } from './head-speed.js';
import { isFloor } from './layout.js';
import { styled } from '../core/style-sheet.js';

/**
 * One head, which the sheet that is open has.
 * @param {HTMLElement} monitor
 * @param {import('../core/store.js').Store} store
 */
export function mount(monitor, store) {
  void styled('drawers');
  const aged = html('span', { class: 'sub', 'data-f': 'head-age' });
  const mark = icon('ok', 's');
  const worst = html('b', { 'data-f': 'head-worst' });
  const head = html('div', { class: 'sheet-head', role: 'group', 'aria-label': 'The car' });
  mountHeadSpeed(head, store);
  head.append(aged, html('span', { class: 'worst' }, mark, worst));

  function draw() {
    const sheet = monitor.dataset['sheet'];
    if (!sheet) return;
    const { age_s, ink } = store.ink('speed');
    setText(aged, age_s === null ? '' : `${age(age_s)} s`);
    setAttribute(aged, 'data-ink', ink);
    const seen = stripOf(store.frame, { isSilent: store.isSilent, chain: store.chain, paused_s: (store.frame?.session.paused_for_s ?? 0) + store.lag_s });
    setAttribute(head, 'data-kind', seen.kind || null);
    setIcon(mark, seen.icon);
    setSentence(worst, seen.text);
  }

  function place() {
    const sheet = monitor.querySelector(':scope > .view > dialog[open]:not([data-docked])');
    if (!sheet) return;
    if (head.parentElement !== sheet) {
      sheet.prepend(head);
      sheet.scrollTop = 0; // the browser kept in place what had the focus
    }
    draw();
  }

  const free = showGauge(monitor);
  const seen = new MutationObserver(place);
  seen.observe(monitor, { attributeFilter: ['data-sheet'] });
  seen.observe(need(monitor, '.view'), { childList: true });
  place();
  const off = store.on('draw', draw);
  return () => {
    seen.disconnect();
    free();
    off();
    head.remove();
  };
}

/**
 * Over a sheet of a phone stands the gauge: Home is scrolled to it, and back unless it was scrolled meanwhile.
 * @param {HTMLElement} monitor
 */
function showGauge(monitor) {
  const home = need(monitor, '[data-panel="home"]');
  let left_px = 0;
  const opened = new MutationObserver(() => {
    const isOpen = 'sheet' in monitor.dataset;
    if (isOpen && home.scrollTop > 0 && !isFloor()) {
      left_px = home.scrollTop;
      home.scrollTop = 0;
    } else if (!isOpen) {
      if (left_px && home.scrollTop === 0) home.scrollTop = left_px;
      left_px = 0;
    }
  });
  opened.observe(monitor, { attributeFilter: ['data-sheet'] });
  return () => opened.disconnect();
}
