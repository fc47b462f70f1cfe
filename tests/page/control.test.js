// The texts of control, of who hears alarms, of its own phone and of the phones at the car.

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { askedOf, chipOf, controlWords, noticeOf, reachOf, seconds, sheetOf } from '../../static/js/control/control-layout.js';
import { isApple } from '../../static/js/phone/device-status.js';
import { phoneOf } from '../../static/js/map/map-text.js';
import { nameOf, othersOn, phoneRow, phonesLine } from '../../static/js/phone/phones-layout.js';
import { rowsOf, verdictOf } from '../../static/js/phone/this-phone-layout.js';

const FREE = { holder: null, page: null, fence: null, former: null, requests: [] };
const ANNS = { ...FREE, holder: 'Ann', page: 'page-a', fence: 7 };
const here = (page, name, more = {}) => ({ page, name, can: true, why: null, why_text: null, here: true, awake: 'ready', vibrates: true, battery: null, charging: null, heard_s: 0.1, ...more });

test('the chip shows you, a name, no one, or that nobody knows', () => {
  assert.deepEqual(['page-a', 'page-b'].map((page) => chipOf(ANNS, page, false).text), ['You', 'Ann']);
  assert.equal(chipOf(FREE, 'page-a', false).text, 'No one');
  assert.equal(chipOf(FREE, '', false).is, 'free'); // a page without a name is not the holder of nothing
  assert.equal(chipOf(ANNS, 'page-a', true).text, '?');
  assert.equal(chipOf(null, 'page-a', false).text, '?');
  assert.equal(chipOf({ holder: null }, 'page-a', false).text, 'No one');
});

test('the key of the control sheet names what it offers, or who is in control', () => {
  const chip = (/** @type {any} */ control, duty = /** @type {any} */ (null)) => chipOf(control, 'page-a', false, duty);
  const free = chip({ holder: null });
  assert.equal(controlWords(free, 'demo', false), 'Take control of demo');
  assert.equal(controlWords(free, 'demo', true), 'No one is in control of demo', 'a viewer cannot take it');
  assert.equal(controlWords(chip({ holder: null }, { me: { name: 'Ann' } }), 'demo', false), 'Take control of demo');
  assert.equal(controlWords(chip(ANNS), 'demo', false), 'You are in control of demo');
  assert.equal(controlWords(chip(ANNS, { me: { name: 'Ann' } }), 'demo', false), 'You are in control of demo, on duty as Ann');
  assert.equal(controlWords(chipOf(ANNS, 'page-b', false), 'demo', false), 'Ann is in control of demo');
  assert.match(controlWords(chipOf(null, 'page-a', true), 'demo', false), /unknown who is in control$/);
});

test('how many hear alarms', () => {
  assert.deepEqual(reachOf({ can: 2, of: 3, why: 'sound off', pages: [], left_out: 0 }), { text: 'Alarms audible on 2 of 3 operator pages', why: 'sound off', isBad: false });
  assert.equal(reachOf({ can: 1, of: 1, why: '', pages: [], left_out: 0 }).text, 'Alarms audible on 1 of 1 operator page');
  assert.equal(reachOf(null).text, 'Alarms audible: not known');
  assert.equal(reachOf({ can: 0, of: 1, why: '', pages: [], left_out: 0 }).text, 'Nobody can hear alarms (1 operator)');
  assert.deepEqual(reachOf({ can: 0, of: 0, why: '', pages: [], left_out: 0 }), { text: 'Nobody can hear alarms (no operator)', why: '', isBad: true });
  assert.equal(reachOf(null).isBad, false);
});

test('what happened to control is announced to whom it concerns', () => {
  const event = (act, page, before_page, by_page) => ({ n: 1, at_ms: 0, alarm: null, change: 'control', text: 'So it is.', by: null, act, page, before_page, by_page });
  const notices = (...args) => ['page-a', 'page-b', 'page-c'].map((page) => noticeOf(event(...args), page)?.title ?? null);
  assert.deepEqual(notices('taken', 'page-a', null, 'page-a'), [null, 'Control was taken', 'Control was taken']);
  assert.deepEqual(notices('taken_over', 'page-b', 'page-a', 'page-b'), ['You lost control', null, 'Control changed']);
  assert.deepEqual(notices('handed_over', 'page-b', 'page-a', 'page-a'), [null, 'You are in control', 'Control changed']);
  assert.deepEqual(notices('granted', 'page-b', 'page-a', null), ['You lost control', 'You are in control', 'Control changed']);
  assert.deepEqual(notices('lapsed', null, 'page-a', null), ['You lost control', 'Nobody is in control', 'Nobody is in control']);
  assert.deepEqual(notices('returned', 'page-a', null, 'page-a'), ['You are in control again', 'Control is back', 'Control is back']);
  assert.deepEqual(notices('requested', 'page-a', null, 'page-b'), [null, null, 'Control requested']);
  assert.deepEqual(notices('kept', 'page-a', null, 'page-a'), [null, 'Control is kept', 'Control is kept']);
  assert.deepEqual(notices('released', null, 'page-a', 'page-a'), [null, 'Nobody is in control', 'Nobody is in control']);
  assert.equal(noticeOf(event('lapsed', null, 'page-a', null), 'page-b')?.offers, 'take');
  assert.equal(noticeOf(event('taken_over', 'page-b', 'page-a', 'page-b'), 'page-a')?.offers, 'request');
});

test('the sheet offers what can be done from here', () => {
  const reach = { can: 2, of: 3, why: '', left_out: 0, pages: [here('page-a', 'Ann'), here('page-b', 'Ben'), here('page-c', 'Cem', { here: false })] };
  assert.equal(sheetOf(FREE, reach, 'page-a').state, 'free');
  const mine = sheetOf(ANNS, reach, 'page-a');
  assert.equal(mine.state, 'you');
  assert.deepEqual(mine.handTo.map((one) => one.name), ['Ben']); // Cem sleeps
  assert.equal(sheetOf(ANNS, reach, 'page-b').state, 'other');
  const asking = sheetOf({ ...ANNS, requests: [{ page: 'page-b', name: 'Ben', left_s: 6.2 }] }, reach, 'page-b');
  assert.deepEqual([asking.state, asking.text], ['asking', 'You requested control. It is granted in 7 s unless it is refused.']);
  const lapsed = sheetOf({ ...FREE, former: { name: 'Ann', page: 'page-a', may_return_s: 12 } }, reach, 'page-b');
  assert.match(lapsed.text, /Ann can reclaim it for 12 s\.$/);
  assert.equal(sheetOf({ holder: null }, null, 'page-a').state, 'free');
});

test('only the holder answers a request, the oldest first', () => {
  const contested = { ...ANNS, requests: [{ page: 'page-b', name: 'Ben', left_s: 3 }, { page: 'page-c', name: 'Cem', left_s: 8 }] };
  assert.equal(askedOf(contested, 'page-a')?.name, 'Ben');
  assert.equal(askedOf(contested, 'page-b'), null);
  assert.equal(askedOf(ANNS, 'page-a'), null);
  assert.equal(askedOf(null, 'page-a'), null);
  assert.deepEqual([0, 0.1, 9.9, -1].map(seconds), ['0 s', '1 s', '10 s', '0 s']);
});

const PHONE = { sound: 'ready', screen: 'ready', position: 'ready', positionSays: '', isInCar: false, vibrates: true, battery: 0.6, charging: false, isOnline: true, network: 'wifi', lag_s: 0.1, isApple: false, isSecure: true, isReplaying: false };
const tags = (more) => Object.fromEntries(rowsOf({ ...PHONE, ...more }).map((row) => [row.what, [row.tag, row.kind, row.text]]));

test('a phone that is armed is shown as ready', () => {
  assert.equal(verdictOf(PHONE).can, true);
  assert.ok(rowsOf(PHONE).every((row) => row.kind === 'plain'));
});

test('each thing that keeps a phone from alarming has its own text', () => {
  const why = (more) => verdictOf({ ...PHONE, ...more }).text;
  assert.match(why({ sound: 'interrupted' }), /a call or another app uses the sound/);
  assert.match(why({ sound: 'asks' }), /the page was not touched yet/);
  assert.match(why({ sound: 'refused' }), /sound was not allowed/);
  assert.match(why({ sound: 'missing' }), /no sound/);
  assert.match(why({ isOnline: false }), /offline/);
  assert.match(why({ lag_s: 2.1 }), /No data from the server/);
  assert.match(why({ isReplaying: true }), /shows a recording/);
});

test('what an iPhone lacks is named as such', () => {
  const found = tags({ isApple: true, vibrates: false, battery: null, charging: null, screen: 'missing' });
  assert.equal(found['Vibration'][2], 'On an iPhone no page can vibrate.');
  assert.equal(found['Battery'][2], 'An iPhone does not show its battery level to pages. Check it yourself.');
  assert.match(found['Screen stays awake'][2], /from iOS 16\.4 on/);
  assert.match(found['Alarm sound'][2], /silent switch may mute it/);
});

test('battery, network and position: low, far and missing', () => {
  assert.deepEqual(tags({ battery: 0.12 })['Battery'].slice(0, 2), ['12 %', 'warn']);
  assert.deepEqual(tags({ battery: 0.12, charging: true })['Battery'].slice(0, 2), ['12 %', 'plain']);
  assert.deepEqual(tags({ isOnline: false })['Network'].slice(0, 2), ['Offline', 'warn']);
  assert.deepEqual(tags({ lag_s: 1.5 })['Network'].slice(0, 2), ['Slow', 'warn']);
  assert.match(tags({ network: 'cellular' })['Network'][2], /join the car’s Wi-Fi/);
  assert.match(tags({ position: 'missing', isSecure: false })['Position'][2], /needs HTTPS/);
  assert.match(tags({ positionSays: 'The phone finds no position.', isInCar: true })['Position'][2], /finds no position\. This device is in the car\./);
  assert.match(tags({ screen: 'missing', isSecure: false })['Screen stays awake'][2], /needs HTTPS/);
});

test('which phones are iPhones', () => {
  assert.ok(isApple('Mozilla/5.0 (iPhone; CPU iPhone OS 17_4 like Mac OS X)', 5));
  assert.ok(isApple('Mozilla/5.0 (Macintosh; Intel Mac OS X 10_15_7)', 5)); // an iPad
  assert.ok(!isApple('Mozilla/5.0 (Macintosh; Intel Mac OS X 10_15_7)', 0));
  assert.ok(!isApple('Mozilla/5.0 (Linux; Android 14; Pixel 7)', 5));
});

const at = (id, more = {}) => ({ id, label: `phone ${id}`, handheld: true, lat_deg: 32.23, lon_deg: -110.95, accuracy_m: 5, sigma_m: 3.3, alt_m: null, speed_mps: null, heading_deg: null, at_ms: 0, age_s: 0.5, used: true, why: null, why_text: null, compared: false, chosen: false, ...more });

test('each phone with its own text', () => {
  assert.deepEqual(phoneRow(at('aaaa', { chosen: true, compared: true }), 0.1, 'aaaa'), { id: 'aaaa', name: 'You', text: 'Accurate to 5 m, 0.6 s ago.', tag: 'In the car', isChosen: true });
  const denied = phoneRow(at('bbbb', { used: false, why: 'denied', why_text: 'Location permission denied on this phone', age_s: null, accuracy_m: null }), 0, 'aaaa');
  assert.deepEqual([denied.name, denied.text, denied.tag], ['phone bbbb', 'Location permission denied on this phone.', '']);
  assert.equal(nameOf(at('cccc', { label: null }), 'aaaa'), 'A phone');
});

test('in one line, which is compared and why', () => {
  const line = (...phones) => phonesLine({ phones }, 'aaaa');
  assert.deepEqual(line(at('aaaa', { compared: true })), { text: '1 phone shares its position', why: 'Using yours. Choose the phone in the car' });
  assert.equal(line(at('bbbb', { compared: true, chosen: true }), at('aaaa')).why, 'phone bbbb is in the car');
  assert.equal(line(at('bbbb')).why, '');
});

test('the others on the map: live, stale, and none without a place', () => {
  const shown = (one, lag_s = 0) => othersOn({ phones: [one] }, lag_s, 'aaaa')[0];
  assert.deepEqual([shown(at('bbbb'))?.label, shown(at('bbbb'))?.isLive], ['phone bbbb ±5 m', true]);
  assert.equal(shown(at('bbbb'), 5)?.isLive, false);
  assert.equal(shown(at('bbbb', { used: false, why: 'silent' }))?.label, 'phone bbbb STALE 0.5 s');
  assert.equal(shown(at('bbbb', { used: false, why: 'coarse', accuracy_m: 80 }))?.isLive, true);
  assert.equal(shown(at('bbbb', { lat_deg: null, lon_deg: null })), undefined);
  assert.equal(shown(at('bbbb', { compared: true })), undefined); // drawn as the phone
});

test('among several the phone that is compared has its own name too', () => {
  const label = (count, page) => phoneOf({ phone: { ...at('bbbb', { compared: true }), count }, phones: [] }, 0, page).label;
  assert.equal(label(1, 'aaaa'), 'Phone ±5 m');
  assert.equal(label(2, 'aaaa'), 'phone bbbb ±5 m');
  assert.equal(label(2, 'bbbb'), 'You ±5 m');
});

test('a device shows the key by which agents know it, where any requires a signature', () => {
  /** @type {any} */
  const facts = { sound: 'ready', screen: 'ready', position: 'ready', positionSays: '', isInCar: false, vibrates: true, battery: 1, charging: true, isOnline: true, network: '', lag_s: 0, isApple: false, isSecure: true, isReplaying: false };
  const rows = (/** @type {string | null} */ key) => rowsOf({ ...facts, key }).filter(({ what }) => what === 'Signed orders').map(({ tag, kind }) => [tag, kind]);
  assert.deepEqual([rows(null), rows(''), rows('k4f2a91c3000')], [[], [['Not available', 'warn']], [['4f2a91c3', 'plain']]]);
});
