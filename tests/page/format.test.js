import assert from 'node:assert/strict';
import { test } from 'node:test';
import { age, bearing, duration, fixed, heading, pieces, signed, timeOfDay } from '../../static/js/core/format.js';

test('a number has a true minus, never −0.0, and unknown is a dash', () => {
  assert.equal(fixed(4.25, 1), '4.3');
  assert.equal(fixed(-110.9501161, 6), '−110.950116');
  assert.equal(fixed(-0.04), '0.0');
  assert.equal(fixed(null), '–');
  assert.equal(fixed(NaN), '–');
  assert.equal(fixed(Infinity), '–');
  assert.equal(fixed(0), '0.0');
});

test('a signed number', () => {
  assert.deepEqual([0.3, -0.3, 0, 0.01, -0.01, null].map((v) => signed(v)), ['+0.3', '−0.3', '0.0', '0.0', '0.0', '–']);
});

test('ages and durations', () => {
  assert.deepEqual([0.016, 0.5, 3.44, 59.9, 59.96, 125].map((s) => age(s, 2)), ['0.02', '0.50', '3.4', '59.9', '0:59', '2:05']);
  assert.equal(age(-0.2), '0.0');
  assert.equal(age(null), '–');
  assert.equal(duration(42.9), '0:42');
  assert.equal(duration(252, true), '04:12');
  assert.equal(duration(3725), '1:02:05');
});

test('time of day', () => {
  assert.equal(timeOfDay(new Date(2026, 0, 2, 14, 7, 31).getTime()), '14:07:31');
  assert.equal(timeOfDay(null), '–');
});

test('a bearing is counter-clockwise: negative is right', () => {
  assert.deepEqual(bearing(-0.052), { degrees: '3°', side: 'right' });
  assert.deepEqual(bearing(0.0175), { degrees: '1°', side: 'left' });
  assert.deepEqual(bearing(0.001), { degrees: '0°', side: 'ahead' });
  assert.equal(bearing(null), null);
});

test('a heading is clockwise from north', () => {
  assert.deepEqual(heading(87.2), { degrees: '087°', point: 'E' });
  assert.deepEqual(heading(359.9), { degrees: '000°', point: 'N' });
  assert.deepEqual(heading(-45), { degrees: '315°', point: 'NW' });
});

test('the numbers of a sentence are distinguished from its text', () => {
  const numbers = (/** @type {string} */ text) => pieces(text).filter((piece) => piece.unit !== undefined).map((piece) => piece.text);
  assert.deepEqual(numbers('192.168.4.1 is there, but nothing listens on port 9090.'), ['192.168.4.1', '9090']);
  assert.deepEqual(numbers('12.6 m/s, limit 11.0 m/s since 14:07:31'), ['12.6', '11.0', '14:07:31']);
  assert.deepEqual(numbers('Float64 is not cmd_vel2'), []);
  assert.equal(pieces('a 1 b').map((piece) => piece.text + (piece.unit ?? '')).join(''), 'a 1 b');
  assert.deepEqual(pieces(''), []);
});

test('a number has its unit, and no other text', () => {
  const units = (/** @type {string} */ text) => pieces(text).flatMap(({ unit }) => unit ?? []);
  assert.deepEqual(units('12.6 m/s, limit 11.0 m/s since 14:07:31, at −1.1 m/s² for 2.5 s'), [' m/s', ' m/s', '', ' m/s²', ' s']);
  assert.deepEqual(units('61 of 75 Hz, 12 %, 57.1 MB at 3 MB/s, 45 km/h, 28 mph, 5 min'), [' of', ' Hz', ' %', ' MB', ' MB/s', ' km/h', ' mph', ' min']);
  assert.deepEqual(units('3 alarms, 2 cars waiting, 4 m_x, 5 a/b'), ['', '', '', '']);
  assert.deepEqual(units('5 °C, 3 kbit/s, 10 m/min, 4 cars'), [' °C', ' kbit/s', ' m/min', '']);
});

test('a part of a name is no number', () => {
  assert.deepEqual(pieces('45m 4.5m Pixel 57f2'), [{ text: '45m 4.5m Pixel 57f2' }]);
});
