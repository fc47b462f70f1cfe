// What a page does not need from the start: each part is fetched with the first state that has something for it.

import { styled } from '../core/style-sheet.js';

/** After a failure it is fetched again with a later frame [ms]. */
const AGAIN_MS = 1000;

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {(sentence: string, title?: string) => void} Say
 * @typedef {{mount: (monitor: HTMLElement, store: Store, say: Say) => unknown}} Part
 * @type {[(frame: import('../core/protocol-types.js').State) => boolean, () => Promise<Part>][]}
 */
const PARTS = [
  // The style sheets of alarms and orders, which other pages fetch some seconds later.
  [({ alarms: [alarm], decelerate, link }) => Boolean(alarm ?? decelerate.order ?? decelerate.countdown ?? link.cut), () => Promise.all([styled('drawers'), styled('drive')]).then((come) => (come.includes(false) ? Promise.reject() : { mount() {} }))],
  [({ questions }) => Boolean(questions?.length), () => import('../settings/questions.js')],
  [({ session }) => Boolean(session.planned_stop), () => import('../alarms/planned-stop.js')],
];

/** @param {HTMLElement} monitor @param {Store} store @param {Say} say */
export function whenWanted(monitor, store, say) {
  for (const [isWanted, load] of PARTS) {
    const wait = () => {
      const off = store.on('draw', () => {
        if (!store.frame || !isWanted(store.frame)) return;
        off();
        load().then(({ mount }) => mount(monitor, store, say)).catch(() => setTimeout(wait, AGAIN_MS));
      });
    };
    wait();
  }
}
