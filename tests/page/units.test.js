import assert from 'node:assert/strict';
import { afterEach, test } from 'node:test';
import { chooseSpeedUnit, inUnits, shownIn, speedIn, speedUnit, speedWords, spokenSpeedUnit, wireOf } from '../../static/js/core/units.js';

afterEach(() => chooseSpeedUnit('m/s'));

test('m/s is what a phone shows without a chosen unit', () => {
  assert.equal(speedUnit(), 'm/s');
  assert.deepEqual(speedWords(4.2), ['4.2', 'm/s']);
  assert.equal(inUnits('12.6 m/s, limit 11.0 m/s'), '12.6 m/s, limit 11.0 m/s');
});

test('a speed by the definition of each unit', () => {
  chooseSpeedUnit('km/h');
  assert.deepEqual(speedWords(10), ['36.0', 'km/h']);
  assert.equal(spokenSpeedUnit(), 'kilometres an hour');
  chooseSpeedUnit('mph');
  assert.deepEqual(speedWords(44.704, 2), ['100.00', 'mph']);
});

test('unknown stays unknown, and is never 0', () => {
  chooseSpeedUnit('km/h');
  assert.equal(speedIn(null), null);
  assert.equal(speedIn(undefined), undefined);
  assert.deepEqual(speedWords(null), ['–', 'km/h']);
  assert.deepEqual(speedWords(NaN), ['–', 'km/h']);
});

test('only speeds are converted', () => {
  chooseSpeedUnit('km/h');
  assert.deepEqual(shownIn(5, 'm'), { value: 5, unit: 'm' });
  assert.deepEqual(shownIn(3, 'm/s²'), { value: 3, unit: 'm/s²' });
  assert.deepEqual(shownIn(10, 'm/s'), { value: 36, unit: 'km/h' });
});

test('what is set in km/h comes back as it was set', () => {
  chooseSpeedUnit('km/h');
  for (const shown of [1.8, 39.6, 40, 50, 144]) assert.equal(Number((speedIn(wireOf(shown, 'm/s')) ?? 0).toFixed(3)), shown);
  assert.equal(wireOf(5.5, 'm'), 5.5);
  chooseSpeedUnit('m/s');
  assert.equal(wireOf(0.123456789, 'm/s'), 0.123456789);
});

test('the speeds of a sentence follow, nothing else does', () => {
  chooseSpeedUnit('km/h');
  const cases = /** @type {[string, string][]} */ ([
    ['12.6 m/s, limit 11.0 m/s', '45.4 km/h, limit 39.6 km/h'],
    ['FAULT 12.6 m/s', 'FAULT 45.4 km/h'],
    ['Speed limit: 11 → 9 m/s', 'Speed limit: 39.6 → 32.4 km/h'],
    ['Speed limit: 0.5 to 40 m/s is allowed.', 'Speed limit: 1.8 to 144 km/h is allowed.'],
    ['-3.0 m/s', '−10.8 km/h'],
    ['braking 0.3 m/s², at least 0.5 m/s²', 'braking 0.3 m/s², at least 0.5 m/s²'],
    ['5 m ahead', '5 m ahead'],
    ['/topic/3 m/sec', '/topic/3 m/sec'],
    ['45.4 km/h', '45.4 km/h'],
    ['', ''],
  ]);
  for (const [from, to] of cases) assert.equal(inUnits(from), to);
});

test('of two speeds the larger stays the larger', () => {
  chooseSpeedUnit('mph');
  const read = (/** @type {string} */ text) => Number.parseFloat(inUnits(text));
  for (let tenths = 1; tenths < 600; tenths += 1) {
    assert.ok(read(`${((tenths + 1) / 10).toFixed(1)} m/s`) > read(`${(tenths / 10).toFixed(1)} m/s`), String(tenths));
  }
});
