// The sheet of a comparison's signals: those of both recordings, and which of them lacks one.

import { html, listen, setAttribute } from '../core/dom.js';
import { MOST, chooseSignals, chosenSignals } from '../home/drive-choice.js';
import { addSheet, openSheet } from '../shell/sheet.js';

/** @param {Record<'a' | 'b', import('./compare-feed.js').SideFeed>} feeds */
export function openPicker(feeds) {
  const offered = { ...feeds.b.answer?.offered, ...feeds.a.answer?.offered };
  const boxes = Object.entries(offered).map(([name, { label, unit }]) => {
    const box = /** @type {HTMLInputElement} */ (html('input', { type: 'checkbox', value: name }));
    box.checked = chosenSignals().includes(name);
    const lacking = /** @type {const} */ (['a', 'b']).filter((side) => feeds[side].answer?.offered[name]?.has_data === false).map((side) => side.toUpperCase());
    return { box, row: html('li', {}, html('label', {}, box, html('span', {}, html('b', {}, label), html('small', {}, `${unit ? ` ${unit}` : ''}${lacking.length ? ` · no data in ${lacking.join(' and ')}` : ''}`)))) };
  });
  const sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed trends-pick', 'aria-labelledby': 'cmp-pick-title' },
    html('div', { class: 'bd' }, html('h2', { id: 'cmp-pick-title' }, 'Signals'), html('p', { class: 'sub' }, `Up to ${MOST} signals of both recordings`)),
    html('ul', { class: 'trends-list' }, ...boxes.map(({ row }) => row)), html('div', { class: 'keys' }, html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close'))));
  const look = () => {
    const count = boxes.filter(({ box }) => box.checked).length;
    for (const { box } of boxes) setAttribute(box, 'disabled', box.checked ? count === 1 : count >= MOST);
  };
  const stops = [addSheet(sheet), ...boxes.map(({ box }) => listen(box, 'change', () => {
    const names = chosenSignals().filter((name) => name !== box.value);
    chooseSignals(box.checked ? [...names, box.value] : names);
    look();
  }))];
  sheet.addEventListener('close', () => stops.reverse().forEach((stop) => stop()), { once: true });
  look();
  openSheet(sheet);
}
