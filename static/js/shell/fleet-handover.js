// "Hand over": the people who announce the alarms of a car; it is offered to one of them, and stays assigned to this page until they accept.

import { addSheet, closeSheet, openSheet } from './sheet.js';
import { html, icon } from '../core/dom.js';

/** @typedef {import('../core/protocol-types.js').PagePerson} PagePerson */

/**
 * Those who can take over every one of these cars, without this page.
 * @param {import('../core/protocol-types.js').Cars | null} cars
 * @param {string[]} names
 * @param {string} page
 * @returns {PagePerson[]}
 */
export function peopleOf(cars, names, page) {
  const lists = (cars?.cars ?? []).filter(({ name }) => names.includes(name)).map(({ summary }) => summary?.people ?? []);
  return (lists[0] ?? []).filter((one) => one.page !== page && lists.every((list) => list.some((other) => other.page === one.page)));
}

/**
 * @param {string} name of the car, or "31 cars"
 * @param {PagePerson[]} people
 * @param {(to: PagePerson) => void} choose
 */
export function openHandover(name, people, choose) {
  const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close', 'data-f': 'no' }, icon('close'));
  const list = html('ul', { class: 'menu-list', 'data-f': 'people' });
  const effect = people.length ? 'It is assigned to you until they accept.' : 'Nobody else announces the alarms of this car now.';
  const sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-hand', 'aria-labelledby': 'hand-title' },
    html('div', { class: 'hand-head' }, html('h2', { id: 'hand-title' }, `Hand over ${name}`), close), list, html('p', { class: 'bd small sub' }, effect)));
  for (const person of people) {
    const key = html('button', { type: 'button', 'data-page': person.page }, icon('operator'), html('span', {}, person.name));
    key.addEventListener('click', () => {
      closeSheet(sheet);
      choose(person);
    });
    list.append(html('li', {}, key));
  }
  const took = document.activeElement;
  const take = addSheet(sheet);
  sheet.addEventListener('close', () => {
    take();
    if (took instanceof HTMLElement && took.isConnected) took.focus({ preventScroll: true });
  }, { once: true });
  openSheet(sheet);
}
