import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { armWords, bare, dialled, foundIn, isSameCar, remembered } from '../../static/js/shell/connect-layout.js';
import { screenOf } from '../../static/js/shell/router.js';
import { details, headline, kindWords } from '../../static/js/home/signals.js';
import { tabByHash, tabByKey } from '../../static/js/shell/tabs.js';
import { lastKnown, savedWords } from '../../static/js/shell/dialogs.js';
import { recordingWords } from '../../static/js/shell/topbar.js';
import { thenWords, titleOf } from '../../static/js/shell/veil.js';
import { state } from './frames.js';

test('tabs by key and by link', () => {
  assert.deepEqual(['ArrowRight', 'ArrowLeft', 'Home', 'End', 'x'].map((key) => tabByKey(key, 0, 4)), [1, 0, 0, 4, null]);
  assert.equal(tabByKey('ArrowRight', 4, 4), 4);
  assert.deepEqual(['#map', '#SCAN', '', '#nothing'].map((hash) => tabByHash(hash, ['home', 'map', 'scan'])), [1, 2, -1, -1]);
});

test('which screen is in front', () => {
  assert.equal(screenOf({ frame: null, isMonitoring: false }, false), 'start');
  assert.equal(screenOf({ frame: state({ session: { phase: 'idle' } }), isMonitoring: false }, false), 'connect');
  assert.equal(screenOf({ frame: state(), isMonitoring: true }, false), 'monitor');
  assert.equal(screenOf({ frame: state(), isMonitoring: true }, true), 'connect');
});

test('what the phone refused is shown, with what it costs', () => {
  assert.deepEqual(armWords('position', 'refused'), { tag: 'Refused', kind: 'warn', cost: 'Refused: phone and car are not compared' });
  assert.equal(armWords('screen', 'missing').cost, 'Needs HTTPS: the screen may turn off and hide alarms');
  assert.equal(armWords('sound', 'ready').tag, 'Ready');
  assert.equal(armWords('sound', 'asks').kind, 'unk');
});

test('addresses: each once, newest first, and not too many', () => {
  assert.deepEqual(remembered(['a', 'b'], 'b'), ['b', 'a']);
  assert.equal(remembered(Array.from({ length: 20 }, (_, i) => String(i)), 'x').length, 8);
  assert.equal(bare('ws://car:9090/'), 'car:9090');
  assert.equal(bare('wss://car:9090'), 'wss://car:9090');
  assert.equal(bare('ws://car/bridge'), 'ws://car/bridge'); // without its scheme it would have another port
  for (const written of ['car', 'car:9090', ' ws://car:9090/ ', 'CAR']) assert.ok(isSameCar('ws://car:9090', written), written);
  assert.ok(isSameCar('ws://[::1]:9090', '[::1]'));
  for (const other of ['', 'car:9091', 'cart', 'wss://car:9090', 'ws://car']) assert.ok(!isSameCar('ws://car:9090', other), other);
});

test('what is dialled: the port of the scheme, and that of rosbridge without a scheme', () => {
  const rows = {
    'car': 'ws://car:9090', ' Car.Local ': 'ws://car.local:9090', 'car:9091': 'ws://car:9091', 'car:': 'ws://car:9090',
    'ws://car': 'ws://car:80', 'ws://car/bridge': 'ws://car:80/bridge', 'wss://car': 'wss://car:443', 'WSS://car/b?x=1': 'wss://car:443/b?x=1',
    'wss://car:9090/': 'wss://car:9090', 'car/bridge': 'ws://car:9090/bridge', 'car?x=1': 'ws://car:9090/?x=1', 'car/ü%20': 'ws://car:9090/%C3%BC%20',
    'foxglove://car': 'foxglove://car:8765', 'Foxglove+TLS://Car:9/x': 'foxglove+tls://car:9/x',
    'fd00::1': 'ws://[fd00::1]:9090', '[fd00::1]': 'ws://[fd00::1]:9090', 'wss://[fd00::1]/x': 'wss://[fd00::1]:443/x',
  };
  for (const [typed, url] of Object.entries(rows)) assert.equal(dialled(typed), url, typed);
  for (const typed of ['', '  ', 'my car', 'http://car', 'ftp://car', 'foxglove:car', 'foxglove+ws://car', 'ws:/car', 'ws:car', 'ws://', 'car:0', 'car:70000', 'car:abc', 'a:1:2', 'car:11311', 'ros@car', '<b>']) assert.equal(dialled(typed), '', typed);
});

test('what is shown is what the server dials, for each spelling of a table that the tests of the server read too', () => {
  const rows = JSON.parse(readFileSync(new URL('../server/rosbridge/spellings.json', import.meta.url), 'utf8'));
  assert.ok(rows.length > 200);
  for (const [typed, url] of rows) assert.equal(dialled(typed), url ?? '', JSON.stringify(typed));
  const longest = `ws://car/${'x'.repeat(291)}`;
  assert.deepEqual([dialled(longest) !== '', dialled(`${longest}x`)], [true, '']);
});

test('found vehicles are listed once, and an answer of another shape is none', () => {
  assert.deepEqual(foundIn({ found: [{ name: 'Sim', address: 'ws://127.0.0.1:9091' }], vehicles: [{ name: 'car', address: '127.0.0.1:9091', phase: 'idle' }, { name: 'b', address: null }] }),
    [{ name: 'Sim', address: 'ws://127.0.0.1:9091', phase: undefined }]);
  for (const answer of [null, 7, {}, { found: 'x' }, { found: [null, 7, {}] }]) assert.deepEqual(foundIn(answer), []);
});

test('the headline of each signal; unknown is a dash and never 0', () => {
  assert.deepEqual(headline('speed', { speed_mps: 4.2 }), ['4.2', 'm/s']);
  assert.deepEqual(headline('scan', { beams: 181 }), ['181', 'beams']);
  assert.deepEqual([headline('bearing', { bearing_rad: -0.052 }), headline('bearing', { bearing_rad: null })], [['3°', 'right'], ['–', '']], 'as on Home');
  assert.deepEqual([headline('steering', { percent: -4.04 }), headline('steering', { percent: null })], [['4.0', '% left'], ['–', '%']]);
  assert.deepEqual(headline('acceleration', { acceleration_mps2: 0.3 }), ['+0.3', 'm/s²']);
  assert.deepEqual(headline('distance', { distance_m: null, none_in_range: true }), ['none', '']);
  assert.deepEqual(headline('position', { status: -1, alt_m: 1 }), ['no', 'fix']);
  assert.deepEqual(headline('diagnostics', { worst: 2 }), ['ERROR', '']);
  assert.deepEqual(headline('fuel', { value: 62.5, unit: '%' }), ['62.5', '%']);
  assert.deepEqual(headline('oil', { value: 92.04 }, '°C'), ['92.0', '°C']);
  assert.deepEqual(headline('command', { speed_mps: null }), ['–', 'm/s']);
  assert.deepEqual(headline('speed', null), ['–', '']);
  assert.deepEqual(headline('something_new', { percent: 7 }), ['7.0', '%']);
});

test('the details of a signal tell what was rejected and why', () => {
  const signal = /** @type {any} */ ({ label: 'Speed', topic: '/v', type: 'geometry_msgs/Twist', note: 'Float64, expected Float32', count: 9, rejected: 2, rejected_why: 'linear.x is text', lowest: 0, highest: 4.23, value: {}, horizon_s: 1, expected_hz: 20 });
  const rows = Object.fromEntries(details(signal, 'speed'));
  assert.equal(rows['Rejected'], '2: linear.x is text');
  assert.equal(rows['Note'], 'Float64, expected Float32');
  assert.equal(rows['Range so far'], '0.00 to 4.23');
  assert.equal(kindWords(signal), 'Twist');
  assert.equal(kindWords({ ...signal, type: null, topic: null, value: { source: 'speed' } }), 'from speed');
  assert.equal(kindWords({ ...signal, type: null, topic: null, value: null }), 'no such topic');
  assert.equal(kindWords({ ...signal, value: { source: 'odometry' } }), 'from odometry', 'its own topic holds no value');
  assert.equal(kindWords({ ...signal, value: { source: 'topic' } }), 'Twist');
});

test('recording and last values', () => {
  const bar = (/** @type {any} */ recording, isSilent = false) => {
    const { isOn, text, order } = recordingWords({ for_s: 252, reason: null, ...recording }, isSilent);
    return [isOn, text, order];
  };
  assert.deepEqual(bar({ state: 'off', for_s: null }), [false, 'off', true]);
  assert.deepEqual(bar({ state: 'recording' }), [true, '04:12', false]);
  assert.deepEqual(bar({ state: 'held' }), [false, 'held', false]);
  assert.deepEqual(bar({ state: 'saving' }), [false, 'saving', null]);
  assert.deepEqual(bar({ state: 'stopped' }), [false, 'fault', true]);
  assert.deepEqual(bar({ state: 'recording' }, true), [false, '?', null], 'a silent server: nobody knows');
  assert.equal(recordingWords({ state: 'stopped', for_s: 9, reason: 'The disk is full.' }, false).title, 'Recording stopped. The disk is full.');
  const saved = { name: 'car_1', until_ms: new Date(2026, 0, 2, 9, 41, 7).getTime() };
  assert.equal(savedWords({ state: 'held', for_s: 9, saved }), ' Recording saved up to 09:41:07.');
  assert.equal(savedWords({ state: 'saving', for_s: 9, saved: null }), ' The recording is being saved.');
  assert.equal(savedWords({ state: 'recording', for_s: 9, saved }), '', 'what is not saved is not stated to be');
  assert.equal(savedWords({ state: 'off', for_s: null, saved }), '');
  assert.equal(thenWords(state({ signals: { speed: { value: { speed_mps: 4.2 } }, distance: { value: { distance_m: 12.4 } } } })), '4.2 m/s, object at 12.4 m');
  assert.equal(thenWords(null), '');
  const title = (/** @type {any} */ view, /** @type {any} */ car_s) => titleOf({ age_s: 5, ...view }, car_s);
  assert.equal(title({ state: 'Silent' }, null), 'No values yet', 'no value is stale that never was');
  assert.deepEqual([title({ state: 'Silent' }, 5), title({ state: 'Lost' }, null), title({ state: 'Lost', age_s: null }, null), title({ state: 'Waking' }, 1)], ['Stale 5.0 s', 'Stale 5.0 s', 'Stale', 'Waking']);
  const known = { speed: { value: { speed_mps: 4.2 } } };
  const store = (/** @type {object} */ frame) => /** @type {any} */ ({ frame, signal: (/** @type {string} */ name) => state(frame).signals[name], ink: () => ({ age_s: 1 }), limit: () => 2 });
  assert.equal(lastKnown(store(state({ signals: known }))), ' Last known: 4.2 m/s, ≤ 5.2 m unseen.');
  assert.equal(lastKnown(store(state({ signals: {} }))), '', 'nothing is known');
  assert.equal(lastKnown(store(state({ signals: known, replay: {} }))), '', 'a recording has no car of now');
});
