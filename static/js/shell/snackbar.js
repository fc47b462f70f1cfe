// Warnings: one snackbar at a time over the rail, until it is acknowledged, shelved or over. The list of alarms needs none.

import { layOut } from '../alarms/alarm-layout.js';
import { titleOf } from '../alarms/alarm-title.js';
import { html, icon, listen, setAttribute, setIcon, setText, setSentence, show } from '../core/dom.js';
import { areAlarmsInSight, floorQuery } from './layout.js';
import { Meant } from '../core/meant.js';
import { openShelve } from '../alarms/shelve.js';
import { joinWords, markWords, snackWords } from '../alarms/standing.js';

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @param {(sentence: string, title?: string) => void} say
 */
export function mount(root, store, say) {
  const title = html('b');
  const text = html('span');
  const shelve = html('button', { type: 'button', class: 'key' }, 'Shelve');
  const acknowledge = html('button', { type: 'button', class: 'key solid' }, 'Acknowledge');
  const mark = icon('warn');
  const bar = html('div', { class: 'snack', role: 'status', hidden: true, 'data-f': 'warning' }, html('div', { class: 'side' }, mark),
    html('div', { class: 'tx' }, title, text), html('div', { class: 'ac' }, shelve, acknowledge));
  root.append(bar);
  /** @type {import('../core/protocol-types.js').StandingAlarm | null} */
  let shown = null;
  const meant = new Meant(bar);
  let shownKey = '';

  acknowledge.addEventListener('click', async (event) => {
    if (!shown || !meant.by(event)) return;
    const answer = await store.ask('acknowledge', { alarm: shown.id, occurrence: shown.occurrence });
    if (!answer.ok) say(answer.reason ?? 'Refused.', 'Not acknowledged');
  });
  shelve.addEventListener('click', (event) => shown && meant.by(event) && openShelve(store, shown, say));

  function draw() {
    const isListed = areAlarmsInSight() || document.querySelector('.screen:not([hidden]) [data-f="alarms"]') !== null; // with keys of its own, which this would cover
    const waiting = store.isSilent || !store.frame || store.replaying || isListed ? [] : layOut(store.frame.alarms).snackbars;
    shown = waiting[0] ?? null;
    show(bar, shown !== null);
    const key = shown ? `${shown.id} ${shown.occurrence}` : '';
    if (shown && key !== shownKey) meant.moved();
    shownKey = key;
    if (!shown) return;
    setAttribute(bar, 'data-priority', shown.priority);
    setIcon(mark, shown.priority === 'advisory' ? 'info' : 'warn');
    setAttribute(bar, 'data-ended', !shown.active);
    setSentence(title, `${titleOf(shown)}${waiting.length > 1 ? ` (${waiting.length} alarms)` : ''}`);
    setSentence(text, joinWords(snackWords(shown), markWords(shown)));
    show(shelve, shown.active && shown.priority !== 'critical' && shown.actions.includes('shelve'));
    setText(acknowledge, 'Acknowledge');
  }

  draw();
  const stops = [store.on('draw', draw), listen(floorQuery(), 'change', draw)]; // a window made larger has the list: not both until the next state
  return () => stops.forEach((stop) => stop());
}
