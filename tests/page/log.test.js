import assert from 'node:assert/strict';
import { test } from 'node:test';
import { heldWords } from '../../static/js/shell/connect-layout.js';
import { filterParams, dayWords, eventWords, joined, lowest, standingRows, tookWords } from '../../static/js/alarms/log-layout.js';
import { dialogWords, joinWords, loadWords, snackWords, standingWords } from '../../static/js/alarms/standing.js';

const ALARM = /** @type {any} */ ({ active: true, text: '12.6 m/s', trip_text: '11.2 m/s', state: 'UNACKED', acknowledged_by: null, shelved_by: null, shelved_until_ms: null });
const noon_ms = new Date(2026, 5, 1, 12, 0, 0).getTime();

test('who acknowledged stands where the alarm stands', () => {
  assert.equal(standingWords(ALARM), '12.6 m/s · unacknowledged');
  assert.equal(standingWords({ ...ALARM, active: false, state: 'RTN_UNACKED' }), '11.2 m/s · ended, unacknowledged');
  assert.equal(standingWords({ ...ALARM, state: 'ACKED', acknowledged_by: 'Pixel 7 · a3f2' }), '12.6 m/s · acknowledged by Pixel 7 · a3f2');
  assert.equal(standingWords({ ...ALARM, state: 'ACKED', text: '' }), '11.2 m/s · acknowledged');
  assert.equal(
    standingWords({ ...ALARM, state: 'SHELVED', shelved_by: 'Ann', shelved_until_ms: noon_ms }), '12.6 m/s · shelved by Ann until 12:00:00',
  );
});

test('a snackbar never tells of what is over as if it stood', () => {
  assert.equal(snackWords({ ...ALARM, active: true }), '12.6 m/s');
  assert.equal(
    snackWords({ ...ALARM, active: true, verdict: 'unknown', text: 'No link to the car' }), 'Not checked now: no link to the car. It was: 11.2 m/s',
  );
  assert.equal(snackWords({ ...ALARM, active: false, state: 'RTN_UNACKED' }), 'Returned to normal. It was: 11.2 m/s');
  assert.equal(snackWords({ ...ALARM, active: false, trip_text: '', title: 'GPS jump' }), 'Returned to normal.', 'its title stands above');
  const ended = { ...ALARM, active: false, state: 'RTN_UNACKED', title: 'GPS drift', trip_text: 'GPS drift' };
  assert.equal(snackWords(ended), 'Returned to normal.', 'it is named once');
  assert.equal(snackWords({ ...ended, worst: { value: 6.3, unit: 'm', side: 'above' } }), 'Returned to normal. Highest 6.3 m.');
  assert.equal(joinWords('Returned to normal.', 'planned stop'), 'Returned to normal · planned stop');
  assert.equal(joinWords('Returned to normal. It was: 6.3 m', ''), 'Returned to normal. It was: 6.3 m');
});

test('what its check finds well is never the text of an alarm that stands', () => {
  const clearing = { ...ALARM, title: 'Phone position missing', verdict: 'ok', text: 'Position of the phone known to 5 m', trip_text: 'No GPS fix on this phone for 16 s' };
  assert.equal(snackWords(clearing), 'Returning to normal: Position of the phone known to 5 m. It was: No GPS fix on this phone for 16 s');
  assert.equal(standingWords({ ...clearing, active: false, state: 'RTN_UNACKED' }), 'No GPS fix on this phone for 16 s · ended, unacknowledged');
});

test('too many alarms are shown in one line; what can be borne is a number only', () => {
  const load = { in_10_min: 0, flood: false, bearable: true, chattering: [] };
  assert.equal(loadWords(load), '');
  assert.equal(loadWords({ ...load, in_10_min: 11, flood: true, bearable: false }), 'Alarm flood: 11 in 10 min');
  assert.equal(loadWords({ ...load, in_10_min: 3, bearable: false, chattering: ['GPS jump'] }), 'Chattering: GPS jump');
  assert.equal(loadWords(undefined), '');
});

test('what stood when the server ended is shown where a car is chosen', () => {
  const held = { address: 'ws://192.168.4.1:9090', alarms: 2, paused: false };
  assert.equal(heldWords(held), 'The server was restarted while it monitored 192.168.4.1:9090: 2 alarms were active. Connect to it to continue.');
  assert.match(heldWords({ ...held, alarms: 1, paused: true }), /1 alarm was active and monitoring was paused/);
  for (const none of [null, undefined, { ...held, alarms: 0 }, { ...held, address: null }]) assert.equal(heldWords(none), '');
});

/** @param {number} n @param {object} [more] */
const event = (n, more = {}) => /** @type {any} */ ({ n, at_ms: noon_ms + n * 1000, alarm: 'speed_limit', occurrence: 1, change: 'raised', title: 'Speed above limit', priority: 'critical', text: '12.6 m/s', by: null, ...more });
const row = (/** @type {any} */ one) => ({ event: one, gap: null });
const GAP = { event: null, gap: { blind_s: 14, raised: 1, cleared: 0, at_ms: noon_ms } };

test('what is here and what was fetched make one list; a blind time is never filtered away', () => {
  const here = [row(event(9)), GAP, row(event(8, { alarm: null, change: 'paused', title: null, priority: null, text: 'Paused', by: 'Ann' }))];
  const older = [event(8), event(7, { priority: 'warning', title: 'GPS jump', alarm: 'gps_jump' }), event(6)];
  const numbers = (/** @type {any} */ filter) => joined(/** @type {any} */ (here), older, filter).map(({ event: one }) => one?.n ?? 'gap');
  assert.deepEqual(numbers({ kind: 'all', text: '' }), [9, 'gap', 8, 7, 6]);
  assert.deepEqual(numbers({ kind: 'critical', text: '' }), [9, 'gap', 6]);
  assert.deepEqual(numbers({ kind: 'other', text: '' }), ['gap', 8]);
  assert.deepEqual(numbers({ kind: 'all', text: ' gps JUMP ' }), ['gap', 7]);
  assert.deepEqual(numbers({ kind: 'all', text: 'ann' }), ['gap', 8]);
  assert.deepEqual(numbers({ kind: 'warning', text: 'speed' }), ['gap']);
  assert.equal(lowest(/** @type {any} */ (here)), 8);
  assert.equal(lowest(/** @type {any} */ ([GAP])), null);
});

test('a filter becomes the query that the page means', () => {
  assert.deepEqual(filterParams({ kind: 'all', text: '  ' }), {});
  assert.deepEqual(filterParams({ kind: 'other', text: 'a&b ' }), { alarm: '', text: 'a&b' });
  assert.deepEqual(filterParams({ kind: 'advisory', text: '' }), { priority: 'advisory' });
});

test('days are named as people name them', () => {
  const now_ms = new Date(2026, 10, 21, 0, 0, 5).getTime();
  const day = (/** @type {[number, number, number, number?]} */ ...at) => dayWords(new Date(at[0], at[1], at[2], at[3] ?? 12).getTime(), now_ms);
  assert.equal(day(2026, 10, 21, 0), 'Today');
  assert.equal(day(2026, 10, 20, 23), 'Yesterday');
  assert.equal(day(2026, 10, 20, 0), 'Yesterday');
  assert.equal(day(2026, 10, 19), 'Thursday, 19 November');
  assert.equal(day(2025, 11, 31), 'Wednesday, 31 December 2025');
});

test('an acknowledgement tells how long the alarm waited for it', () => {
  const rows = /** @type {any} */ ([row(event(12, { change: 'acknowledged' })), GAP, row(event(10, { occurrence: 2 })), row(event(9))]);
  assert.equal(tookWords(event(12, { change: 'acknowledged' }), rows), 'after 3.0 s');
  assert.equal(tookWords(event(12, { change: 'acknowledged', occurrence: 3 }), rows), '');
  assert.equal(tookWords(event(12, { change: 'cleared' }), rows), '');
});

test('a dialog tells with what it began, and never speaks in the present of what is over or not checked', () => {
  const near = { ...ALARM, active: true, verdict: 'fault', text: '4.1 m', trip_text: '4.8 m', raised_ms: noon_ms, for_s: 3.5, advice: 'Brake.', measured: null, limit: null };
  assert.equal(dialogWords(near), '4.1 m. Active for 3.5 s. Began 12:00:00: 4.8 m. Brake.');
  assert.match(dialogWords({ ...near, for_s: 725 }), / Active for 12:05\. /);
  assert.equal(dialogWords({ ...near, measured: {}, limit: {}, trip_text: '4.1 m' }), 'Active for 3.5 s. Began 12:00:00. Brake.');
  assert.match(dialogWords({ ...near, trip_text: 'Obstacle 3.5 m ahead' }), / Began 12:00:00: obstacle 3.5 m ahead\./);
  assert.match(dialogWords({ ...near, trip_text: 'GPS has no fix' }), / Began 12:00:00: GPS has no fix\./, 'an abbreviation');
  assert.match(dialogWords({ ...near, trip_text: 'Lidar error', causes: ['Lidar'] }), / Began 12:00:00: Lidar error\./, 'a name');
  const lost = { ...near, verdict: 'unknown', text: 'No link to the car.' };
  assert.equal(dialogWords(lost), 'Not checked now: no link to the car. Active for 3.5 s. Began 12:00:00: 4.8 m. Brake.');
  assert.equal(dialogWords({ ...lost, active: false }), 'It has returned to normal. Began 12:00:00: 4.8 m.', 'nothing is to be done about what has ended');
});

test('a dialog tells how bad it was, where that is not what is measured now', () => {
  const speed = (/** @type {number} */ value) => ({ label: 'Speed', value, unit: 'm/s' });
  const fast = { ...ALARM, active: true, verdict: 'fault', trip_text: ALARM.text, raised_ms: noon_ms, for_s: 3.5, advice: 'Brake.', measured: speed(12.6), limit: speed(11), worst: { ...speed(12.84), side: 'above' } };
  assert.equal(dialogWords(fast), 'Active for 3.5 s. Began 12:00:00. Highest 12.8 m/s. Brake.');
  assert.equal(dialogWords({ ...fast, measured: speed(12.81) }), 'Active for 3.5 s. Began 12:00:00. Brake.', 'what reads the same is not written twice');
  assert.equal(dialogWords({ ...fast, active: false, measured: speed(12.84) }), 'It has returned to normal. Began 12:00:00. Highest 12.8 m/s.');
  assert.match(dialogWords({ ...fast, worst: { ...speed(3.9), side: 'below' } }), /Lowest 3\.9 m\/s\./);
});

test('what a hand-over made of an alarm is shown, and one that is unacknowledged again looks like a raise', () => {
  const row = (/** @type {string} */ change) => eventWords(event(1, { change, by: 'Ben' }));
  assert.deepEqual([row('handed_over').icon, row('handed_over').title, row('handed_over').text], ['ok', 'Speed above limit taken over', '12.6 m/s · by Ben']);
  assert.deepEqual([row('unacknowledged').icon, row('unacknowledged').title], ['crit', 'Speed above limit unacknowledged again']);
});

test('an event that the log had lost names where it is from', () => {
  const brought = { brought_from: 'car_20261128T080000Z' };
  assert.equal(eventWords(event(1, { by: 'Ben', ...brought })).text, '12.6 m/s · by Ben · brought back from car_20261128T080000Z');
  assert.equal(eventWords(event(2, { alarm: null, change: 'connected', text: 'Connected', ...brought })).text, 'brought back from car_20261128T080000Z');
});

test('what nobody was alerted of bears a mark, in the list of what stands and in what happened', () => {
  const shelved = /** @type {any} */ ({ id: 'gps', occurrence: 1, title: 'GPS drift', priority: 'critical', state: 'SHELVED', active: true, raised_ms: 0, text: '6 m', trip_text: '', actions: [], shelved_until_ms: 0, shelved_by: 'Ann' });
  const suppressed = /** @type {any} */ ({ id: 'fix', title: 'GPS fix lost', priority: 'critical', by: ['Car silent'], raised_ms: null });
  const rows = standingRows([{ ...shelved, state: 'UNACKED' }, shelved], [suppressed]);
  assert.deepEqual(rows.map(({ icon, colour, kind }) => [icon, colour, kind]), [['crit', 'c-crit', 'unacknowledged'], ['clock', '', 'shelved'], ['bell-off', '', 'suppressed']]);
  assert.match(rows[1]?.text ?? '', /shelved by Ann until/);
  assert.equal(rows[2]?.text, 'suppressed · cause: Car silent');
  const wordsOf = (/** @type {any} */ more) => eventWords(/** @type {any} */ ({ alarm: 'gps', change: 'raised', title: 'GPS drift', text: '6 m', by: null, priority: 'warning', ...more })).text;
  assert.equal(wordsOf({ state: 'SHELVED' }), '6 m · while shelved');
  assert.equal(wordsOf({ state: 'SHELVED', change: 'shelved' }), '6 m');
  assert.equal(wordsOf({ state: 'SUPPRESSED', suppressed_by: ['car_silent'] }), '6 m · suppressed by another alarm');
  assert.equal(wordsOf({ state: 'SUPPRESSED', suppressed_by: ['paused', 'car_silent'] }), '6 m · suppressed: monitoring is paused');
  assert.equal(wordsOf({ state: 'UNACKED' }), '6 m');
});
