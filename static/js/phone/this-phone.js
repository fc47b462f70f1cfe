// The sheet of what this phone can do: sound, screen, vibration, battery, network, position; and arms it.

import { html, icon, setSentence, textNodes } from '../core/dom.js';
import { addSheet, openSheet } from '../shell/sheet.js';
import { rowsOf, verdictOf } from './this-phone-layout.js';

const RESULTS = { sounding: 'That was an alarm sound. If you did not hear it, turn the media volume up.', missing: 'This browser has no sound.', blocked: 'The phone blocks this page’s sound: touch the page, then try again.', busy: 'An alarm is already sounding.' };

/**
 * @param {import('../core/store.js').Store} store
 * @param {import('../boot/arming.js').Arming} arming
 * @param {import('./device-status.js').DeviceStatus} deviceStatus
 */
export function openThisPhone(store, arming, deviceStatus) {
  const verdict = html('p', { class: 'sub', id: 'this-phone-words', role: 'status' });
  const list = html('ul', { class: 'arm' });
  const arm = html('button', { type: 'button', class: 'key solid wide', 'data-f': 'arm' }, 'Turn on alarms');
  const test = html('button', { type: 'button', class: 'key wide', 'data-f': 'test' }, 'Test the sound');
  const sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed tall', id: 'sheet-this-phone', 'aria-labelledby': 'this-phone-title', 'aria-describedby': 'this-phone-words' },
    html('div', { class: 'bd' }, html('h2', { id: 'this-phone-title' }, 'This device'), verdict), html('div', { class: 'menu-list' }, list),
    html('div', { class: 'keys' }, html('div', { class: 'pair' }, test, arm), html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close'))));
  let shown = '';
  let result = '';

  function factsNow() {
    const { alarmSound, arms } = arming;
    const mine = (store.frame?.phones ?? []).find((one) => one.id === store.page);
    return {
      ...arms, sound: alarmSound.isInterrupted ? /** @type {const} */ ('interrupted') : arms.sound, positionSays: mine?.why_text ? `${mine.why_text}.` : '', isInCar: mine?.chosen === true,
      vibrates: deviceStatus.vibrates, battery: deviceStatus.battery, charging: deviceStatus.charging, isOnline: deviceStatus.isOnline, network: deviceStatus.network, lag_s: store.lag_s,
      isApple: deviceStatus.isApple, isSecure: window.isSecureContext, isReplaying: store.replaying, key: store.seal.key,
    };
  }

  function draw() {
    const facts = factsNow();
    setSentence(verdict, result || verdictOf(facts).text);
    const rows = rowsOf(facts);
    const key = JSON.stringify(rows);
    if (key === shown) return;
    shown = key;
    list.replaceChildren(...rows.map((row) => html('li', {}, icon(row.icon), html('span', {}, html('span', { class: 't' }, row.what), html('br'), html('span', { class: 'm' }, ...textNodes(row.text))),
      html('span', { class: row.kind === 'plain' ? 'tag' : `tag ${row.kind}` }, ...(row.kind === 'plain' ? [icon('ok', 's')] : row.kind === 'warn' ? [icon('warn', 's')] : []), ...textNodes(row.tag)))));
  }

  arm.addEventListener('click', () => {
    result = '';
    arming.ask();
    draw();
  });
  test.addEventListener('click', async () => {
    result = RESULTS[await arming.alarmSound.test('medium')];
    draw();
  });
  const stops = [store.on('draw', draw), store.on('tick', draw), addSheet(sheet)];
  sheet.addEventListener('close', () => stops.forEach((stop) => stop()), { once: true });
  openSheet(sheet);
  draw();
}
