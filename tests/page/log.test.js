import assert from 'node:assert/strict';
import { test } from 'node:test';
import { heldWords } from '../../static/js/connect.js';
import { loadWords, standingWords } from '../../static/js/standing.js';

const ALARM = /** @type {any} */ ({ text: '12.6 m/s', trip_text: '11.2 m/s', state: 'UNACKED', acknowledged_by: null, shelved_by: null, shelved_until_ms: null });
const noon_ms = new Date(2026, 5, 1, 12, 0, 0).getTime();

test('who acknowledged stands where the alarm stands', () => {
  assert.equal(standingWords(ALARM), '12.6 m/s · not acknowledged');
  assert.equal(standingWords({ ...ALARM, state: 'RTN_UNACKED' }), '12.6 m/s · over, not acknowledged');
  assert.equal(standingWords({ ...ALARM, state: 'ACKED', acknowledged_by: 'Pixel 7 · a3f2' }), '12.6 m/s · acknowledged by Pixel 7 · a3f2');
  assert.equal(standingWords({ ...ALARM, state: 'ACKED', text: '' }), '11.2 m/s · acknowledged');
  assert.equal(
    standingWords({ ...ALARM, state: 'SHELVED', shelved_by: 'Ann', shelved_until_ms: noon_ms }), '12.6 m/s · shelved by Ann until 12:00:00',
  );
});

test('the alarm load in one line, and in one word when it is too much', () => {
  const load = { in_10_min: 0, flood: false, bearable: true, chattering: [] };
  assert.equal(loadWords(load), 'Alarm load: 0 in 10 min');
  assert.equal(loadWords({ ...load, in_10_min: 11, flood: true, bearable: false }), 'Alarm load: 11 in 10 min: flood');
  assert.equal(loadWords({ ...load, in_10_min: 3, bearable: false, chattering: ['GPS jump'] }), 'Alarm load: 3 in 10 min · chattering: GPS jump');
  assert.equal(loadWords(undefined), '');
});

test('what stood when the server ended is said where a car is chosen', () => {
  const held = { address: 'ws://192.168.4.1:9090', alarms: 2, paused: false };
  assert.equal(heldWords(held), 'The server was restarted while it watched 192.168.4.1:9090: 2 alarms stood. Connect to it to go on.');
  assert.match(heldWords({ ...held, alarms: 1, paused: true }), /1 alarm stood and monitoring was paused/);
  for (const none of [null, undefined, { ...held, alarms: 0 }, { ...held, address: null }]) assert.equal(heldWords(none), '');
});
