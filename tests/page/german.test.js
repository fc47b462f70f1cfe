// With the language of the browser set to German, before anything of the page is loaded.

import assert from 'node:assert/strict';
import { test } from 'node:test';

Object.defineProperty(globalThis, 'navigator', { value: { language: 'de-DE' }, configurable: true });
const { NumberFormat } = Intl;
let built = 0;
Intl.NumberFormat = /** @type {any} */ (class extends NumberFormat {
  /** @param {ConstructorParameters<typeof NumberFormat>} given */
  constructor(...given) {
    super(...given);
    built += 1;
  }
});
const { age, distanceWords, fixed, pieces, signed } = await import('../../static/js/core/format.js');
const { chooseSpeedUnit, inUnits, speedWords } = await import('../../static/js/core/units.js');
const { decimalOf, KNOWN, markOf } = await import('../../static/js/core/decimal.js');
const { endText, textOf } = await import('../../static/js/settings/settings-layout.js');
const { unseenWords } = await import('../../static/js/core/unseen.js');
const { rateWords } = await import('../../static/js/replay/replay-layout.js');
const { csvOf } = await import('../../static/js/home/drive-layout.js');

const shown = (/** @type {string} */ text) => pieces(inUnits(text)).map((piece) => piece.text + (piece.unit ?? '')).join('');

test('live values, ages and distances have a comma', () => {
  assert.deepEqual([fixed(4.25), fixed(-0.04), fixed(-110.9501161, 6), fixed(7, 0), fixed(null)], ['4,3', '0,0', '−110,950116', '7', '–']);
  assert.deepEqual([0.3, -0.3, 0, 0.01, null].map((value) => signed(value)), ['+0,3', '−0,3', '0,0', '0,0', '–']);
  assert.deepEqual([age(0.5, 2), age(3.44), age(125)], ['0,50', '3,4', '2:05']);
  assert.deepEqual([distanceWords(10.4), distanceWords(4200)], [['10,4', 'm'], ['4,2', 'km']]);
  assert.deepEqual([unseenWords(2.71), rateWords(0.25)], ['≤ 2,8 m unseen', '×0,25']);
});

test('the mark of a usual language is known without the long start of Intl, and is that of Intl', () => {
  assert.equal(fixed(4.25), '4,3');
  assert.equal(built, 0, 'a number was drawn without it');
  for (const [language, mark] of Object.entries(KNOWN)) assert.equal(new NumberFormat(language).formatToParts(1.5).find(({ type }) => type === 'decimal')?.value, mark, language);
  assert.deepEqual([markOf('fr'), markOf('de-CH'), markOf('no language'), built], [',', '.', '.', 2]);
});

test('so have the sentences of the server; addresses, versions and times do not', () => {
  assert.equal(shown('12.6 m/s, limit 11.0 m/s since 14:07:31'), '12,6 m/s, limit 11,0 m/s since 14:07:31');
  assert.equal(shown('192.168.4.1 is there with TLS 1.3, version 2.1 of 1.0.2, but nothing listens on port 9090.'), '192.168.4.1 is there with TLS 1.3, version 2.1 of 1.0.2, but nothing listens on port 9090.');
});

test('limits and the ends of a range have one, and are taken with one; what may mean thousands is refused', () => {
  const field = /** @type {any} */ ({ title: 'Limit', unit: 'm/s', minimum: 0.5, maximum: 30, default: 11, step: 0.1 });
  assert.deepEqual([textOf(11.5, field), endText(0.5, field)], ['11,5', '0,5']);
  assert.deepEqual([decimalOf('1,5'), decimalOf('1.5'), decimalOf('1,105')], [1.5, 1.5, 1.105]);
  assert.ok(Number.isNaN(decimalOf('1.100')));
});

test('a sentence of the page, with commas, is turned into another unit whole', () => {
  chooseSpeedUnit('km/h');
  assert.equal(shown(`Highest ${fixed(12.6)} m/s, limit ${fixed(11)} m/s`), 'Highest 45,4 km/h, limit 39,6 km/h');
  assert.equal(shown('12.6 m/s, limit 11 m/s'), '45,4 km/h, limit 39,6 km/h');
  assert.deepEqual(speedWords(4.2), ['15,1', 'km/h']);
  chooseSpeedUnit('m/s');
});

test('tables for programs keep the point', () => {
  const answer = /** @type {any} */ ({ from_s: 0, step_s: 1, start_ms: 0, signals: { speed: { lowest: [1.5], highest: [2.5] } } });
  const csv = csvOf(answer, [/** @type {any} */ ({ name: 'speed', title: 'Speed', unit: 'm/s' })], [0, 1]);
  assert.match(csv, /,0\.00,1\.5,2\.5\r\n$/);
});

test('a number costs no time that 20 frames a second would notice', () => {
  const count = 200_000;
  const begun = performance.now();
  for (let i = 0; i < count; i += 1) fixed(i / 7);
  const each_us = ((performance.now() - begun) / count) * 1000;
  assert.ok(each_us < 50, `${each_us} µs`); // 100 numbers a frame: less than 5 ms of 50
});
