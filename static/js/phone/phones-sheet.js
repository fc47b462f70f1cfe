// The sheet of all phones that share their position: why one has no position, and which of them is in the car.

import { html, icon, setSentence, textNodes } from '../core/dom.js';
import { phoneRow } from './phones-layout.js';
import { addSheet, openSheet } from '../shell/sheet.js';

/**
 * @param {import('../core/store.js').Store} store
 * @param {(sentence: string, title?: string) => void} say
 */
export function openPhones(store, say) {
  const text = html('p', { class: 'sub', id: 'phones-words', role: 'status' });
  const list = html('ul', { class: 'menu-list phones' });
  const sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-phones', 'aria-labelledby': 'phones-title', 'aria-describedby': 'phones-words' },
    html('div', { class: 'bd' }, html('h2', { id: 'phones-title' }, 'Which phone is in the car?'), text), list,
    html('div', { class: 'keys' }, html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close'))));
  let shown = '';

  /** @param {string | null} phone */
  async function ride(phone) {
    const answer = await store.ask('ride', { phone });
    if (!answer.ok) {
      sheet.close(); // the way to control stands beneath it
      say(answer.reason ?? 'Refused.', 'Not changed');
    }
  }

  function draw() {
    const { frame } = store;
    if (!frame) return;
    setSentence(text, frame.phone?.choice_text ?? 'No phone is sharing its position.');
    const rows = (frame.phones ?? []).map((one) => phoneRow(one, store.lag_s, store.page));
    const key = JSON.stringify(rows);
    if (key === shown) return;
    shown = key;
    const focused = /** @type {HTMLElement | null} */ (document.activeElement)?.dataset['phone'];
    list.replaceChildren(...rows.map((row) => {
      const button = html('button', { type: 'button', 'aria-pressed': String(row.isChosen), 'data-phone': row.id }, icon('phone'),
        html('span', {}, html('b', {}, ...textNodes(row.name)), html('br'), html('span', { class: 'small sub' }, ...textNodes(row.text))),
        ...(row.tag ? [html('span', { class: 'tag' }, row.tag)] : []));
      button.addEventListener('click', () => void ride(row.isChosen ? null : row.id));
      return html('li', {}, button);
    }));
    if (focused) /** @type {HTMLElement | null} */ (list.querySelector(`[data-phone="${CSS.escape(focused)}"]`))?.focus();
  }

  const stops = [store.on('draw', draw), addSheet(sheet)];
  sheet.addEventListener('close', () => stops.forEach((stop) => stop()), { once: true });
  openSheet(sheet);
  draw();
}
