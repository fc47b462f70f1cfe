// The sheet behind the chip: who is in control, how this page gets it or gives it away, and who would hear an alarm.

import { reachOf, sheetOf } from './control-layout.js';
import { html, icon, setText, setWords, show, words } from './dom.js';
import { addSheet, openSheet } from './sheet.js';

/**
 * @typedef {import('./store.js').Store} Store
 * @typedef {import('./control.js').Control} Control
 */

/** @param {Store} store @param {Control} control */
export function openControl(store, control) {
  const key = (/** @type {string} */ label, /** @type {() => void} */ act, kind = 'key wide') => {
    const button = html('button', { type: 'button', class: kind }, ...words(label));
    button.addEventListener('click', act);
    return button;
  };
  const title = html('h2', { id: 'control-title' });
  const text = html('p', { class: 'sub', id: 'control-words', role: 'status' });
  const people = html('ul', { class: 'menu-list people' });
  const keys = html('div', { class: 'keys', 'data-f': 'keys' });
  const reach = html('button', { type: 'button', class: 'reach' });
  const close = html('div', { class: 'keys' }, html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close'));
  const sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-control', 'aria-labelledby': 'control-title', 'aria-describedby': 'control-words' },
    html('div', { class: 'bd' }, title, text), keys, people, reach, close));
  let shown = '';
  let isConfirming = false;

  /** @param {string} act @param {object} [fields] */
  async function order(act, fields) {
    const answer = await control.order(act, fields);
    isConfirming = false;
    if (answer.ok && act !== 'request') sheet.close();
    else draw();
  }

  function draw() {
    const { control: now, page } = store;
    const { frame } = store;
    const told = frame?.replay ? frame.live?.reach : frame?.reach;
    if (!now || !sheet.open) return;
    const seen = sheetOf(now, told, page);
    if (seen.state !== 'other' && seen.state !== 'asking') isConfirming = false;
    const asksOver = isConfirming;
    setText(title, asksOver ? `Take over from ${now.holder}?` : seen.title);
    setWords(text, asksOver ? `${now.holder} may be about to act. Taking over is announced to everyone and logged.` : seen.text);
    const line = reachOf(told);
    reach.replaceChildren(icon(line.isBad ? 'bell-off' : 'bell', 's'), html('span', {}, html('b', {}, ...words(line.text)), ...(line.why ? [html('br'), html('span', { class: 'small sub' }, ...words(line.why))] : [])), icon('next', 's'));
    const kind = JSON.stringify([seen.state, isConfirming, seen.handTo.map((one) => [one.page, one.name, one.can, one.why_text])]);
    if (kind === shown) return;
    shown = kind;
    const had = keys.contains(document.activeElement);
    keys.replaceChildren(...keysOf(seen.state, asksOver));
    show(people, seen.handTo.length > 0);
    people.replaceChildren(...seen.handTo.map((one) => {
      const button = html('button', { type: 'button', 'data-page': one.page }, icon('operator'), html('span', {}, `Hand over to ${one.name}`, html('br'), html('span', { class: 'small sub' }, one.can ? 'can hear alarms' : `cannot hear alarms: ${one.why_text ?? 'unknown'}`)));
      button.addEventListener('click', () => void order('hand_over', { to: one.page }));
      return html('li', {}, button);
    }));
    if (had) /** @type {HTMLElement | null} */ (keys.querySelector('button'))?.focus();
  }

  /** @param {string} state @param {boolean} asksOver */
  function keysOf(state, asksOver) {
    if (state === 'free') return [key('Take control', () => void order('take'), 'main')];
    if (state === 'you') return [key('Give control up', () => void order('release'))];
    if (asksOver) return [key('Take over', () => void order('take_over'), 'main'), key('Back', confirm(false))];
    return [
      ...(state === 'asking' ? [key('Cancel request', () => void order('withdraw'))] : [key('Ask for control', () => void order('request'), 'main')]),
      key('Take over …', confirm(true)),
    ];
  }

  /** @param {boolean} wanted */
  function confirm(wanted) {
    return () => {
      isConfirming = wanted;
      draw();
    };
  }

  const stops = [store.on('draw', draw), addSheet(sheet)];
  reach.addEventListener('click', () => control.openPhone());
  sheet.addEventListener('close', () => stops.forEach((stop) => stop()), { once: true });
  openSheet(sheet);
  draw();
}

