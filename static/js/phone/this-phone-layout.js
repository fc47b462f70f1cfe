// What this phone can do for its operator, row by row: pure functions of what is known of it.

import { age, fixed } from '../core/format.js';

/**
 * @typedef {object} PhoneFacts
 * @property {'ready' | 'refused' | 'asks' | 'missing' | 'interrupted'} sound
 * @property {'ready' | 'refused' | 'asks' | 'missing'} screen
 * @property {'ready' | 'refused' | 'asks' | 'missing'} position
 * @property {string} positionSays why the server has no position of this phone, as a sentence; '' where it has
 * @property {boolean} isInCar this phone was chosen as the one in the car
 * @property {boolean} vibrates
 * @property {number | null} battery 0 … 1
 * @property {boolean | null} charging
 * @property {boolean} isOnline
 * @property {string} network wifi, cellular, 4g …; '' where nobody tells
 * @property {number} lag_s
 * @property {boolean} isApple an iPhone or iPad
 * @property {boolean} isSecure the page came over HTTPS, or from this machine
 * @property {boolean} isReplaying
 * @property {string | null} [key] by which agents know this device; '' where it cannot sign its orders; null: no signature is required
 *
 * @typedef {{icon: string, what: string, tag: string, kind: 'plain' | 'warn' | 'unk', text: string}} Row
 */

/** Less than this, and the battery is spoken of. */
const LOW = 0.2;
/** A link later than this lets alarms come late [s]. */
const SLOW_S = 1;

/** Whether an alarm would be audible from this phone now, and what prevents it. @param {PhoneFacts} facts */
export function verdictOf(facts) {
  if (!facts.isOnline) return { can: false, text: 'This device is offline and receives no alarms.' };
  if (facts.lag_s > 2) return { can: false, text: 'No data from the server: this device receives no alarms.' };
  if (facts.isReplaying) return { can: false, text: 'This page shows a recording, so it does not count as a page that can sound alarms.' };
  if (facts.sound === 'ready') return { can: true, text: 'This device sounds alarms while this page is in the foreground.' };
  const why = { refused: 'sound was not allowed', asks: 'the page was not touched yet', missing: 'this browser has no sound', interrupted: 'a call or another app uses the sound' }[facts.sound];
  return { can: false, text: `This device cannot sound alarms: ${why}.` };
}

/** @param {PhoneFacts} facts @returns {Row[]} */
export function rowsOf(facts) {
  return [soundRow(facts), screenRow(facts), vibrationRow(facts), batteryRow(facts), networkRow(facts), positionRow(facts), ...keyRow(facts)];
}

/** @param {PhoneFacts} facts @returns {Row[]} */
function keyRow({ key = null }) {
  const row = { icon: 'operator', what: 'Signed orders' };
  if (key === null) return [];
  if (!key) return [{ ...row, tag: 'Not available', kind: 'warn', text: 'This page cannot sign orders, which needs HTTPS. Cars may refuse them.' }];
  return [{ ...row, tag: key.slice(1, 9), kind: 'plain', text: `The log of a car names this device by these digits. Its whole key: ${key}` }];
}

/** @param {PhoneFacts} facts @returns {Row} */
function soundRow({ sound, isApple }) {
  const row = { icon: sound === 'ready' ? 'sound' : 'bell-off', what: 'Alarm sound' };
  const silent = isApple ? ' An iPhone’s silent switch may mute it: test it.' : '';
  switch (sound) {
    case 'ready': return { ...row, tag: 'Ready', kind: 'plain', text: `Turn the media volume up.${silent}` };
    case 'interrupted': return { ...row, tag: 'Interrupted', kind: 'warn', text: 'A call or another app uses the sound: return here and touch the page.' };
    case 'missing': return { ...row, tag: 'Not available', kind: 'warn', text: 'This browser has no sound: alarms are shown without sound.' };
    case 'refused': return { ...row, tag: 'Refused', kind: 'warn', text: 'Alarms are shown without sound. Touch the key below.' };
    default: return { ...row, tag: 'Will ask', kind: 'unk', text: 'Browsers allow sound only after a touch.' };
  }
}

/** @param {PhoneFacts} facts @returns {Row} */
function screenRow({ screen, isApple, isSecure }) {
  const row = { icon: 'awake', what: 'Screen stays awake' };
  if (screen === 'ready') return { ...row, tag: 'Ready', kind: 'plain', text: 'The screen stays on while this page is in the foreground.' };
  if (screen === 'asks') return { ...row, tag: 'Will ask', kind: 'unk', text: 'Requested with the first touch.' };
  if (screen === 'refused') return { ...row, tag: 'Refused', kind: 'warn', text: 'The phone may go to sleep, and then it sounds no alarm. Turn battery saving off.' };
  const why = !isSecure ? 'It needs HTTPS.' : isApple ? 'iPhones support it from iOS 16.4 on.' : 'This browser does not support it.';
  return { ...row, tag: 'Not available', kind: 'warn', text: `${why} Set the device’s own screen time-out to never.` };
}

/** @param {PhoneFacts} facts @returns {Row} */
function vibrationRow({ vibrates, isApple }) {
  const row = { icon: 'phone', what: 'Vibration' };
  if (vibrates) return { ...row, tag: 'Ready', kind: 'plain', text: 'Unless the device is set to never vibrate.' };
  return { ...row, tag: 'Not available', kind: 'unk', text: isApple ? 'On an iPhone no page can vibrate.' : 'This browser cannot vibrate the device.' };
}

/** @param {PhoneFacts} facts @returns {Row} */
function batteryRow({ battery, charging, isApple }) {
  const row = { icon: 'rec', what: 'Battery' };
  if (battery === null) return { ...row, tag: 'Unknown', kind: 'unk', text: isApple ? 'An iPhone does not show its battery level to pages. Check it yourself.' : 'This browser does not show the battery level. Check it yourself.' };
  const percent = `${fixed(battery * 100, 0)} %`;
  if (charging) return { ...row, tag: percent, kind: 'plain', text: 'It is being charged.' };
  return battery < LOW ? { ...row, tag: percent, kind: 'warn', text: 'Charge it: with an empty battery it sounds no alarm.' } : { ...row, tag: percent, kind: 'plain', text: '' };
}

/** @param {PhoneFacts} facts @returns {Row} */
function networkRow({ isOnline, network, lag_s }) {
  const row = { icon: 'link', what: 'Network' };
  if (!isOnline) return { ...row, icon: 'link-off', tag: 'Offline', kind: 'warn', text: 'The phone has no network.' };
  const late = `The newest state is ${age(lag_s)} s old.`;
  if (lag_s > SLOW_S) return { ...row, tag: 'Slow', kind: 'warn', text: `${late} Alarms are late by the same time.` };
  const away = network === 'cellular' ? ' Over the mobile network: join the car’s Wi-Fi.' : '';
  return { ...row, tag: away ? 'Mobile' : 'Ready', kind: away ? 'warn' : 'plain', text: `${late}${away}` };
}

/** @param {PhoneFacts} facts @returns {Row} */
function positionRow({ position, positionSays, isSecure, isInCar }) {
  const row = { icon: 'gps', what: 'Position' };
  const riding = isInCar ? ' This device is in the car.' : '';
  if (position === 'missing') return { ...row, tag: 'Not available', kind: 'warn', text: `${isSecure ? 'This browser has no position.' : 'It needs HTTPS.'}${riding}` };
  if (position === 'refused') return { ...row, tag: 'Refused', kind: 'warn', text: `Allow it for this page in the browser’s settings.${riding}` };
  if (position === 'asks') return { ...row, tag: 'Will ask', kind: 'unk', text: `Requested with Connect.${riding}` };
  return positionSays ? { ...row, tag: 'No fix', kind: 'warn', text: `${positionSays}${riding}` } : { ...row, tag: 'Ready', kind: 'plain', text: riding.trim() };
}
