import assert from 'node:assert/strict';
import { test } from 'node:test';
import { soundOf } from '../../static/js/alarms/alarm-layout.js';
import { rowsOf } from '../../static/js/alarms/alarms-layout.js';
import { eventWords } from '../../static/js/alarms/log-layout.js';
import { lineWords, sheetWords, titleOf } from '../../static/js/alarms/planned-stop-layout.js';
import { dialogWords, standingWords } from '../../static/js/alarms/standing.js';
import { rowsOf as carsOf } from '../../static/js/shell/cars-layout.js';
import { timeOfDay } from '../../static/js/core/format.js';

const STOP = /** @type {const} */ ({ reason: 'workshop', by: 'A. K. (Pixel)', since_ms: 1_790_000_000_000, is_speed_known: true });
/** @param {any} [more] @returns {any} */
const alarm = (more) => ({
  id: 'gps_drift', occurrence: 1, title: 'GPS drift', priority: 'warning', state: 'UNACKED', active: true, raised_ms: 0, for_s: 4.1, text: '0.4 m', trip_text: '0.4 m', verdict: 'fault',
  actions: [], shelved_until_ms: null, silenced_until_ms: null, sound: 'none', measured: null, limit: null, advice: 'Look.', planned_stop: true, ...more,
});

test('the line shows why, since when and by whom, and that an unknown speed does not end it', () => {
  assert.equal(titleOf('workshop'), 'Planned stop: in the workshop');
  assert.equal(titleOf(/** @type {any} */ ('of another version')), 'Planned stop');
  assert.equal(lineWords(STOP), `since ${timeOfDay(STOP.since_ms)} by A. K. (Pixel)`);
  assert.match(lineWords({ ...STOP, by: null }), /^since \d\d:\d\d:\d\d$/);
  assert.match(sheetWords(null), /^The car stands on purpose\..* It ends by itself when the car moves\.$/);
  assert.match(sheetWords({ ...STOP, is_speed_known: false }), /does not end by itself until it is\.$/);
});

test('each alarm in it bears the mark wherever it is read, and none without it', () => {
  const row = (/** @type {any} */ more) => rowsOf([alarm(more)], [], true)[0];
  assert.equal(row({})?.state, 'unacknowledged · planned stop');
  assert.deepEqual(row({})?.keys, ['acknowledge'], 'there is no sound to silence');
  assert.equal(row({ planned_stop: false })?.state, 'unacknowledged');
  assert.equal(standingWords(alarm()), '0.4 m · unacknowledged · planned stop');
  assert.match(dialogWords(alarm()), /The car is in a planned stop\. Look\.$/);
  assert.match(dialogWords(alarm({ active: false })), /The car is in a planned stop\.$/);
  assert.doesNotMatch(dialogWords(alarm({ planned_stop: undefined })), /planned stop/);
  const event = /** @type {any} */ ({ n: 1, at_ms: 0, alarm: 'gps_drift', change: 'raised', title: 'GPS drift', priority: 'warning', text: '0.4 m', by: null });
  assert.equal(eventWords({ ...event, planned_stop: 'parked' }).text, '0.4 m · planned stop');
  assert.equal(eventWords(event).text, '0.4 m');
});

test('a critical alarm sounds in it; a warning that makes no sound sounds once it is over', () => {
  const sound = (/** @type {any[]} */ ...alarms) => soundOf(/** @type {any} */ ({ session: {}, decelerate: {}, alarms }), { isServerLost: false, isLossAcknowledged: false });
  const warning = alarm(), critical = alarm({ id: 'obstacle', priority: 'critical', sound: 'high' });
  assert.equal(sound(warning), null);
  assert.equal(sound(warning, critical), 'high');
  assert.equal(sound(alarm({ sound: 'medium', planned_stop: false })), 'medium');
  assert.equal(soundOf(/** @type {any} */ ({ session: { planned_stop: STOP }, decelerate: {}, alarms: [] }), { isServerLost: true, isLossAcknowledged: false }), 'high', 'of a server that is lost');
});

test('of one that is acknowledged the list shows by whom, and for how long it has been active', () => {
  const state = (/** @type {any} */ more) => rowsOf([alarm({ state: 'ACKED', acknowledged_by: 'Ann', planned_stop: false, ...more })], [], true)[0]?.state;
  assert.equal(state({}), 'acknowledged by Ann · active for 4.1 s');
  assert.equal(state({ for_s: 725 }), 'acknowledged by Ann · active for 12:05');
  assert.equal(state({ for_s: 3725, planned_stop: true }), 'acknowledged by Ann · active for 1:02:05 · planned stop');
});

test('the row of another car shows that it stands on purpose', () => {
  const summary = /** @type {any} */ ({
    phase: 'monitoring', paused: false, waiting: 0, worst: null, holder: null, page: null, recording: 'off', recording_for_s: null, slow_down: 'not_armed', planned_stop: 'parked',
    link: { cut: null, bridge_age_s: 0, car_age_s: 0, trying_for_s: 0, connected_for_s: 9 }, speed: { value_mps: 0, freshness: 'fresh', age_s: 0, horizon_s: 1 },
  });
  const text = (/** @type {any} */ more) => carsOf(/** @type {any} */ ({ kind: 'cars', time_ms: 0, cars: [{ name: 'a', age_s: 0, summary: { ...summary, ...more } }] }), 0, '')[0]?.text;
  assert.equal(text({}), 'No alarm, planned stop');
  assert.equal(text({ planned_stop: null }), 'No alarm');
});
