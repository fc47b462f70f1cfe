// The sheet of the drive's chart: which signals it shows, and what is seen as a picture or a table.

import { html, icon, listen, setAttribute, setText } from '../core/dom.js';
import { addSheet, openSheet } from '../shell/sheet.js';
import { MOST, chooseSignals, chosenSignals } from './drive-choice.js';
import { csvOf } from './drive-layout.js';
import { pictureOf, titleOf } from './drive-picture.js';
import { shownIn } from '../core/units.js';

/**
 * @typedef {object} Chart
 * @property {import('../core/store.js').Store} store
 * @property {(sentence: string, title?: string) => void} say
 * @property {() => {answer: import('./drive-layout.js').Answer | null, specs: import('./trends-layout.js').Spec[], view: import('./drive-layout.js').View}} seen
 * @property {import('./drive-panes.js').Panes} panes
 * @property {SVGElement} head
 */

/** @param {Chart} chart */
export function openPicker({ seen, say, panes, head, store }) {
  const note = html('p', { class: 'sub', role: 'status' }, `Up to ${MOST} signals`);
  const boxes = Object.entries(seen().answer?.offered ?? {}).map(([name, { label, unit, has_data }]) => {
    const box = /** @type {HTMLInputElement} */ (html('input', { type: 'checkbox', value: name }));
    box.checked = chosenSignals().includes(name);
    const shown = shownIn(0, unit).unit;
    return { box, row: html('li', {}, html('label', {}, box, html('span', {}, html('b', {}, label), html('small', {}, shown ? ` ${shown}` : '', has_data ? '' : ' · no data in this drive')))) };
  });
  const png = html('button', { type: 'button', class: 'key wide' }, icon('download'), 'Picture');
  const csv = html('button', { type: 'button', class: 'key wide' }, icon('download'), 'Table (CSV)');
  const sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed trends-pick', 'aria-labelledby': 'trends-pick-title' },
    html('div', { class: 'bd' }, html('h2', { id: 'trends-pick-title' }, 'Signals'), note),
    html('ul', { class: 'trends-list' }, ...boxes.map(({ row }) => row)),
    html('div', { class: 'keys' }, html('div', { class: 'pair' }, png, csv), html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close'))));
  const look = () => {
    const chosen = boxes.filter(({ box }) => box.checked);
    for (const { box } of boxes) setAttribute(box, 'disabled', box.checked ? chosen.length === 1 : chosen.length >= MOST);
    setText(note, chosen.length >= MOST ? `${MOST} signals: take one away to add another` : `Up to ${MOST} signals`);
  };
  const stops = [
    addSheet(sheet),
    ...boxes.map(({ box }) => listen(box, 'change', () => {
      const names = chosenSignals().filter((name) => name !== box.value);
      chooseSignals(box.checked ? [...names, box.value] : names);
      look();
    })),
    listen(png, 'click', () => {
      const { answer, view } = seen();
      if (!answer) return;
      const title = titleOf(store.frame?.vehicle ?? 'car', answer, view, store.replaying);
      pictureOf({ panes, head, title }).toBlob((blob) => (blob ? save(blob, `${nameOf(store)}.png`) : say('This browser cannot make a picture.', 'Not saved')));
    }),
    listen(csv, 'click', () => {
      const { answer, specs, view } = seen();
      if (answer) save(new Blob([csvOf(answer, specs, view)], { type: 'text/csv' }), `${nameOf(store)}.csv`);
    }),
  ];
  for (const key of [png, csv]) setAttribute(key, 'disabled', seen().answer === null);
  sheet.addEventListener('close', () => stops.reverse().forEach((stop) => stop()), { once: true });
  look();
  openSheet(sheet);
}

/** @param {Blob} blob @param {string} name */
function save(blob, name) {
  const link = /** @type {HTMLAnchorElement} */ (html('a', { href: URL.createObjectURL(blob), download: name }));
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** @param {import('../core/store.js').Store} store */
function nameOf(store) {
  const at = new Date(store.frame?.replay?.at_ms ?? Date.now()).toISOString().slice(0, 19).replaceAll(/[-:]/g, '');
  return `${(store.frame?.vehicle ?? 'car').replaceAll(/[^\w-]/g, '_')}_trends_${at}`;
}
