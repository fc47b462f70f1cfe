// Preferences of this phone: theme, unit of speeds, the hand of the slow-down, and a trial of the alarm sounds. They change nothing on the server.

import { field, listen, need, setText } from '../core/dom.js';
import { openSheet } from './sheet.js';
import { chooseSpeedUnit, speedUnit } from '../core/units.js';

/**
 * @typedef {import('../alarms/alarm-sound.js').AlarmSound} AlarmSound
 * @typedef {Exclude<import('../alarms/alarm-sound.js').Loud, 'count'>} Loud the alarms’
 */

const PULSES = /** @type {Record<Loud, string>} */ ({ high: 'ten quick pulses', medium: 'three rising pulses', low: 'two falling pulses' });

const sheet = () => /** @type {HTMLDialogElement} */ (need(document, '#sheet-preferences'));

export function openPreferences() {
  openSheet(sheet());
}

/**
 * The message after a trial of a sound; it names why this phone cannot sound.
 * @param {Awaited<ReturnType<AlarmSound['test']>>} result
 * @param {Loud} sound
 */
export function trialWords(result, sound) {
  if (result === 'missing') return 'This browser has no sound: this device sounds no alarms. Use another browser.';
  if (result === 'blocked') return 'This device blocks the page’s sound: no alarm can be heard. Allow sound for this page, then try again.';
  if (result === 'busy') return 'An alarm sounds now: acknowledge it first.';
  return `Sounding now: ${PULSES[sound]}. If you hear nothing, turn the device’s media volume up and silent mode off.`;
}

/**
 * @param {AlarmSound} alarmSound
 * @returns {() => void}
 */
export function mount(alarmSound) {
  const root = document.documentElement;
  const choices = [
    ...keys('themeKey', () => root.dataset['theme'] ?? 'phone', choose),
    ...keys('unitKey', speedUnit, (unit) => chooseSpeedUnit(/** @type {import('../core/units.js').SpeedUnit} */ (unit))),
    ...keys('handKey', () => root.dataset['hand'] ?? 'right', (hand) => keep('hand', hand, 'right')),
  ];
  const message = field(sheet(), 'sound-message');
  const draw = () => {
    for (const { key, value, now } of choices) key.setAttribute('aria-pressed', String(value === now()));
  };
  draw();
  const stops = [
    ...choices.map(({ key, value, act }) => listen(key, 'click', () => {
      act(value);
      draw();
    })),
    ...all('soundKey').map((key) => listen(key, 'click', async () => {
      const sound = /** @type {Loud} */ (key.dataset['soundKey']);
      setText(message, trialWords(await alarmSound.test(sound), sound));
    })),
    listen(sheet(), 'close', () => setText(message, '')),
  ];
  return () => stops.forEach((stop) => stop());
}

/** @param {string} name of the data attribute */
function all(name) {
  return /** @type {HTMLElement[]} */ ([...sheet().querySelectorAll('button')].filter((key) => key.dataset[name] !== undefined));
}

/**
 * @param {string} name
 * @param {() => string} now what is chosen
 * @param {(value: string) => void} act
 */
function keys(name, now, act) {
  return all(name).map((key) => ({ key, value: key.dataset[name] ?? '', now, act }));
}

/** @param {string} theme */
function choose(theme) {
  keep('theme', theme, 'phone');
  window.dispatchEvent(new Event('catgraph-theme'));
}

/**
 * Kept on this phone; early.js puts it in force before the page is painted.
 * @param {string} name
 * @param {string} value
 * @param {string} usual what holds without a choice
 */
function keep(name, value, usual) {
  if (value === usual) delete document.documentElement.dataset[name];
  else document.documentElement.dataset[name] = value;
  try {
    localStorage.setItem(`catgraph.${name}`, value);
  } catch {
    // no storage: it holds until the page is loaded again
  }
}
