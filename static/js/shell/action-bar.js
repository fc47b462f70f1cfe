// The thumb's edge: Stop (confirmed), Pause or Resume. What acts on the car, beside them: slowing.js.

import { mount as mountLedge } from './ledge-place.js';
import { closeSheet, openSheet } from './sheet.js';
import { field, listen, need, setAttribute, setIcon, setText } from '../core/dom.js';

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @param {import('./router.js').Router} router
 */
export function mount(root, store, router) {
  const pause = field(root, 'pause');
  const label = field(root, 'pause-label');
  const mark = need(pause, '.i');
  const stopSheet = /** @type {HTMLDialogElement} */ (need(document, '#sheet-stop'));

  const stops = [
    listen(field(root, 'stop'), 'click', () => openSheet(stopSheet)),
    listen(field(stopSheet, 'yes'), 'click', async () => {
      closeSheet(stopSheet);
      await router.stop();
    }),
    listen(pause, 'click', async () => {
      const isPaused = store.frame?.session.paused === true;
      const answer = await store.ask(isPaused ? 'resume' : 'pause');
      if (!answer.ok) router.say(answer.reason ?? 'Refused.', isPaused ? 'Not resumed' : 'Not paused');
    }),
    listen(field(document, 'planned-stop'), 'click', () => {
      import('../alarms/planned-stop.js').then(({ openPlannedStop }) => openPlannedStop(store, router.say)).catch(() => router.say('This part of the page could not be loaded from the server. Try again.', 'Not opened'));
    }),
    store.on('draw', draw),
    mountLedge(root, store),
  ];

  function draw() {
    const isPaused = store.frame?.session.paused === true;
    setText(label, isPaused ? 'Resume' : 'Pause');
    setAttribute(pause, 'aria-label', isPaused ? 'Resume monitoring' : 'Pause monitoring');
    setAttribute(pause, 'class', isPaused ? 'key solid' : 'key');
    setAttribute(mark, 'class', isPaused ? 'i fill' : 'i');
    setIcon(mark, isPaused ? 'play' : 'pause');
  }

  if (store.frame) draw(); // before the first frame it is not shown
  return () => stops.forEach((stop) => stop());
}
