// The slow-down on the page: its slides, the steps of an order, the key that releases the car, its row on Home and its count-down.
// The texts are in slow-layout.js.

import { field, listen, need, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { Countdown } from './countdown.js';
import { OrderSteps } from './order-steps.js';
import { ReleaseKey } from './release-key.js';
import { UNCONFIRMED, guardWords, holdOf, orderOf, seenOf, stateWord } from './slow-layout.js';
import { SlowSlides } from './slow-slides.js';

/**
 * @param {HTMLElement} root the monitor's board
 * @param {import('../core/store.js').Store} store
 * @param {import('../control/control.js').Control} control
 * @param {import('../control/control.js').Say} say
 * @param {(vehicle: string) => string} shortOf the car's name in at most 8 characters
 */
export function mount(root, store, control, say, shortOf) {
  const home = need(root, '[data-part="slow"]');
  const names = [...document.querySelectorAll('[data-f="legend-name"]')];
  const legends = [...document.querySelectorAll('[data-f="legend-car"]')];
  const openSheet = () => {
    import('./slow-sheet.js').then(({ openSlow }) => openSlow(store, control)).catch(() => say('The slow-down sheet could not be loaded.', 'Not opened'));
  };
  const slides = new SlowSlides(store, { say, openSheet, draw });
  const release = new ReleaseKey(root, store, control, say);
  const steps = new OrderSteps(root, store);

  function draw() {
    const seen = seenOf(store, shortOf(store.vehicle));
    const { now } = seen;
    for (const name of names) setText(name, seen.car ?? '');
    slides.draw(seen);
    const state = stateWord(seen).toLowerCase();
    for (const legend of legends) {
      const dialog = legend.closest('dialog')?.dataset;
      const isTitled = state === 'not confirmed' && dialog?.['alarm']?.split(' ')[0] === UNCONFIRMED && !('ended' in dialog);
      setText(field(legend, 'legend-state'), isTitled ? 'ordered' : state);
      setAttribute(legend, 'data-state', isTitled ? 'ordered' : state);
    }
    const hold = seen.isReplay ? null : holdOf(now);
    setText(field(root, 'legend-left'), hold ? 'slow-down' : seen.isSilent ? 'no answer' : 'monitoring');
    show(field(root, 'stop'), !hold);
    show(field(root, 'pause'), !hold || store.frame?.session.paused === true); // Resume is always available
    release.draw(seen, hold);
    steps.draw(orderOf(now));
    const guard = guardWords(now?.guard, store.lag_s);
    setSentence(field(root, 'rail-guard'), seen.isReplay || seen.isSilent ? '' : `${guard.text}.`);
    setText(field(home, 'slow-state'), `Slow-down: ${state}`);
    setSentence(field(home, 'slow-guard'), now?.state === 'not_available' && now.why && !seen.isSilent ? `${now.why} ${guard.text}.` : `${guard.text}.`);
    setAttribute(home, 'data-state', state);
    show(home, !seen.isReplay); // in a recording it would describe no car
  }

  draw();
  const stops = [store.on('draw', draw), listen(home, 'click', openSheet), ...release.stops, ...slides.stops, ...new Countdown(store).stops];
  return () => stops.forEach((stop) => stop());
}
