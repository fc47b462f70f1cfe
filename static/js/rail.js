// The thumb's edge: Stop (confirmed), Pause or Resume, and the place of the slow-down.

import { closeSheet, openSheet } from './sheet.js';
import { field, listen, need, setAttribute, setIcon, setText } from './dom.js';

/**
 * What the place of the slow-down says.
 * @param {{state: string, why: string | null} | undefined} decelerate
 */
export function slowWords(decelerate) {
  if (!decelerate || decelerate.state === 'not_available') return { title: 'Slow-down off', why: decelerate?.why ?? 'not available' };
  return { title: `Slow-down ${decelerate.state.replaceAll('_', ' ')}`, why: decelerate.why ?? '' };
}

/**
 * @param {HTMLElement} root
 * @param {import('./store.js').Store} store
 * @param {import('./page.js').Page} page
 */
export function mount(root, store, page) {
  const pause = field(root, 'pause');
  const word = field(root, 'pause-word');
  const mark = need(pause, '.i');
  const stopSheet = /** @type {HTMLDialogElement} */ (need(document, '#sheet-stop'));
  const slides = /** @type {HTMLElement[]} */ ([...document.querySelectorAll('[data-f="slow"]')]);

  const stops = [
    listen(field(root, 'stop'), 'click', () => openSheet(stopSheet)),
    listen(field(stopSheet, 'yes'), 'click', async () => {
      closeSheet(stopSheet);
      await page.stop();
    }),
    listen(pause, 'click', async () => {
      const isPaused = store.frame?.session.paused === true;
      const answer = await store.ask(isPaused ? 'resume' : 'pause');
      if (!answer.ok) page.say(answer.reason ?? 'Refused.', isPaused ? 'Not resumed' : 'Not paused');
    }),
    ...slides.map((slide) => listen(slide, 'click', () => {
      const { why } = slowWords(store.frame?.decelerate);
      page.say(`This server cannot slow the car: ${why}. The safety driver stops the car.`, 'Slow-down is off');
    })),
    store.on('draw', draw),
  ];

  function draw() {
    const isPaused = store.frame?.session.paused === true;
    setText(word, isPaused ? 'Resume' : 'Pause');
    setAttribute(pause, 'aria-label', isPaused ? 'Resume monitoring' : 'Pause monitoring');
    setAttribute(pause, 'class', isPaused ? 'key solid' : 'key');
    setAttribute(mark, 'class', isPaused ? 'i fill' : 'i');
    setIcon(mark, isPaused ? 'play' : 'pause');
    const slow = slowWords(store.frame?.decelerate);
    for (const slide of slides) {
      setText(field(slide, 'slow-title'), slow.title);
      setText(field(slide, 'slow-why'), slow.why);
    }
  }

  draw();
  return () => stops.forEach((stop) => stop());
}
