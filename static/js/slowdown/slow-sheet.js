// The sheet behind the slow-down's slide: why it is off, what it would command, and the key that arms it. Made when it is wanted.

import { html, icon, setText, setSentence, show, textNodes } from '../core/dom.js';
import { addSheet, openSheet } from '../shell/sheet.js';
import { seenOf, sheetOf } from './slow-layout.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('../control/control.js').Control} Control
 */

const KEYS = /** @type {const} */ ({ arm: ['Arm', 'main'], disarm: ['Disarm', 'key wide'], ask: ['Request control', 'main'] });

/** @param {Store} store @param {Control} control */
export function openSlow(store, control) {
  const mark = icon('slow');
  const title = html('span');
  const text = html('p');
  const facts = html('dl', { class: 'facts' });
  const guard = html('p', { 'data-f': 'guard' });
  const aid = html('p', { class: 'sub' });
  const message = html('p', { class: 'bad', role: 'status', 'data-f': 'message' });
  const close = html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close');
  const keys = html('div', { class: 'keys' }, message, close); // at the foot, which stays in sight: with them why an order was refused
  const sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-slow', 'aria-labelledby': 'slow-title', 'aria-describedby': 'slow-words' },
    html('div', { class: 'bd' }, html('h2', { id: 'slow-title' }, mark, title), html('div', { id: 'slow-words' }, text, guard, aid)), facts, keys));
  const { vehicle } = store;
  let shown = '';
  let refused = '';

  /** @param {'arm' | 'disarm' | 'ask'} act */
  async function send(act) {
    const answer = act === 'ask' ? await store.ask('control', { do: 'request' }) : await store.ask(act, { vehicle: vehicle || null });
    refused = answer.ok ? '' : (answer.reason ?? 'Refused.');
    if (answer.ok && act === 'ask') refused = 'Requested: control is granted within 10 s unless it is refused. Then arm it.';
    else if (answer.ok) return sheet.close();
    draw();
  }

  /** @param {'arm' | 'disarm' | 'ask'} act */
  function keyOf(act) {
    const [label, kind] = KEYS[act];
    const button = html('button', { type: 'button', class: kind, 'data-act': act }, label);
    button.addEventListener('click', () => void send(act));
    return button;
  }

  function draw() {
    const seen = sheetOf(seenOf(store), store.lag_s);
    setText(title, seen.title);
    setSentence(text, seen.text);
    setSentence(guard, seen.guard);
    guard.toggleAttribute('data-bad', !seen.isGuarded);
    setText(aid, seen.aid);
    setSentence(message, refused || seen.message);
    const key = JSON.stringify([seen.facts, seen.act]);
    if (key === shown) return;
    shown = key;
    show(facts, seen.facts.length > 0);
    facts.replaceChildren(...seen.facts.flatMap(([name, value, isBad]) => [
      html('dt', {}, name), html('dd', isBad ? { class: 'bad' } : {}, ...(isBad ? [icon('warn', 's'), ' '] : []), html('span', {}, ...textNodes(value))),
    ]));
    keys.querySelector('[data-act]')?.remove();
    if (seen.act !== null) close.before(keyOf(seen.act));
  }

  const stops = [store.on('draw', draw), addSheet(sheet)];
  sheet.addEventListener('close', () => stops.forEach((stop) => stop()), { once: true });
  draw();
  openSheet(sheet);
}
