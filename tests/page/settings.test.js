import assert from 'node:assert/strict';
import { afterEach, test } from 'node:test';
import {
  DEFAULTS, changeLines, changeTo, endText, found, groupsOf, readNumber, scaleOf, shareOf, stepped, textOf, valueAt,
} from '../../static/js/settings/settings-layout.js';
import { fileProblem } from '../../static/js/settings/settings-file.js';
import { topicWords } from '../../static/js/settings/settings-topics.js';
import { optionsOf } from '../../static/js/settings/topic-picker.js';
import { trialWords } from '../../static/js/shell/preferences.js';
import { chooseSpeedUnit } from '../../static/js/core/units.js';
import { decimalOf, markOf } from '../../static/js/core/decimal.js';

afterEach(() => chooseSpeedUnit('m/s'));

const speed = { title: 'Speed limit', heading: 'Speed', unit: 'm/s', default: 11, minimum: 0.5, maximum: 40, step: 0.1 };
const base = { title: 'Wheelbase', heading: 'Vehicle', unit: 'm', default: 2.62, minimum: 0.5, maximum: 8, step: 0.01 };
const rate = { title: 'Speed: expected rate', heading: 'Expected rates', unit: 'Hz', default: 0, minimum: 0, maximum: 1000, step: 0.5, description: "0: learn the car's own rate." };
const ahead = { title: 'Laser ahead', heading: 'Vehicle', unit: 'm', default: 2.5, minimum: -2, maximum: 8, step: 0.1 };

/** @returns {import('../../static/js/settings/settings-layout.js').Settings} */
const settings = (more = {}) => ({
  version: 3, profile: { name: 'generic', title: 'Any car', chosen: 'auto', recognised: 'Any car' },
  profiles: [{ name: 'generic', title: 'Any car' }, { name: 'catvehicle', title: 'CATVehicle' }],
  values: { 'speed_limit.max_mps': 9, 'obstacle.wheelbase_m': 2.62 }, defaults: { 'speed_limit.max_mps': 11, 'obstacle.wheelbase_m': 2.62 },
  changed: ['speed_limit.max_mps'], topics: {}, schema: { 'speed_limit.max_mps': speed, 'obstacle.wheelbase_m': base, 'signals.speed_hz': rate }, ...more,
});

test('a slider reaches both ends, and every step of a range has its place', () => {
  for (const field of [speed, base, rate, ahead]) {
    assert.equal(valueAt(0, field), field.minimum);
    assert.equal(valueAt(1, field), field.maximum);
    assert.equal(shareOf(field.minimum, field), 0);
    assert.equal(shareOf(field.maximum, field), 1);
  }
  for (const field of [speed, base, ahead]) {
    for (let value = field.minimum; value <= field.maximum; value += field.step * 7) {
      assert.ok(Math.abs(valueAt(shareOf(value, field), field) - value) <= field.step / 2 + 1e-6, `${field.title} ${value}`);
    }
  }
});

test('to the right is more, everywhere', () => {
  for (const field of [speed, rate, ahead]) {
    let last = -Infinity;
    for (let at = 0; at <= 1000; at += 1) {
      const value = valueAt(at / 1000, field);
      assert.ok(value >= last && value >= field.minimum && value <= field.maximum, `${field.title} at ${at}: ${value}`);
      last = value;
    }
  }
});

test('a range far wider than the usual is stretched where the usual lies', () => {
  assert.ok(shareOf(20, rate) > 0.2, String(shareOf(20, rate)));
  assert.ok(Math.abs(shareOf(20.25, speed) - 0.5) < 1e-9);
});

test('a value is read with the decimals of its steps, and more where it lies between them', () => {
  assert.deepEqual([11, 9.25, 9.123456].map((v) => textOf(v, speed)), ['11.0', '9.25', '9.1235']);
  assert.deepEqual([textOf(2.62, base), textOf(-1.5, ahead), textOf(75, rate)], ['2.62', '−1.5', '75.0']);
  assert.deepEqual([textOf(null, speed), textOf(NaN, speed), textOf(undefined, speed)], ['–', '–', '–']);
  assert.deepEqual([endText(0.5, speed), endText(40, speed), endText(-2, ahead)], ['0.5', '40', '−2']);
});

test('in km/h the steps are round, what is typed is what is read, and the wire has m/s', () => {
  chooseSpeedUnit('km/h');
  assert.equal(scaleOf(speed).step, 0.5);
  assert.equal(textOf(11, speed), '39.6');
  assert.deepEqual(readNumber('40', speed), { value: 11.111111 });
  assert.equal(textOf(11.111111, speed), '40.0');
  assert.equal(textOf(stepped(11, 1, speed), speed), '40.0');
  assert.equal(textOf(valueAt(0.3, speed), speed).slice(-1) % 5, 0);
  assert.deepEqual([endText(0.5, speed), endText(40, speed)], ['1.8', '144']);
  assert.deepEqual(readNumber('144', speed), { value: 40 });
  assert.deepEqual(readNumber('1.8', speed), { value: 0.5 });
  assert.equal(textOf(2.62, base), '2.62');
  chooseSpeedUnit('mph');
  assert.deepEqual([textOf(11, speed), textOf(11.176, speed)], ['24.61', '25.0']);
  assert.deepEqual(readNumber(endText(40, speed), speed), { value: 40 });
  assert.deepEqual(readNumber(endText(0.5, speed), speed), { value: 0.5 });
});

test('an arrow key goes one step; from between two steps to the next', () => {
  assert.equal(stepped(11, 1, speed), 11.1);
  assert.equal(stepped(9.25, 1, speed), 9.3);
  assert.equal(stepped(9.25, -1, speed), 9.2);
  assert.equal(stepped(40, 1, speed), 40);
  assert.equal(stepped(0.5, -10, speed), 0.5);
});

test('a typed number: comma or point, with or without its unit', () => {
  for (const typed of ['9.5', '9,5', ' 9.5 ', '9.5 m/s', '+9.5', '9.50']) assert.deepEqual(readNumber(typed, speed), { value: 9.5 }, typed);
  assert.deepEqual(readNumber('−1,5', ahead), { value: -1.5 });
  assert.deepEqual(readNumber('-1.5', ahead), { value: -1.5 });
  assert.deepEqual(readNumber(',7', speed), { value: 0.7 });
});

test('what could be thousands is refused, in either language, and never read as a thousandth of it', () => {
  const read = (/** @type {string} */ typed, mark = '.') => /** @type {any} */ (readNumber(typed, rate, mark));
  for (const mark of ['.', ',']) {
    for (const typed of ['1.100', '1,100', '11.000', '+1.500', '1.100 Hz']) assert.match(read(typed, mark).refused, /could be 1\d+ or 1/, `${typed} with ${mark}`);
    for (const typed of ['1.1', '1,1', '1.10', '1,10', '1.1000', '0.100', '0,125']) assert.ok('value' in read(typed, mark), `${typed} with ${mark}`);
  }
  assert.deepEqual([read('1.125').value, read('1,125', ',').value], [1.125, 1.125], 'as this language writes it');
  assert.match(read('1.125', ',').refused, /could be 1125 or 1,125/);
  assert.match(read('1,125').refused, /could be 1125 or 1\.125/);
});

test('a number in a field has the mark of the language', () => {
  assert.deepEqual(['de-DE', 'de-AT', 'fr-FR', 'en-GB', 'ja-JP', 'no such language'].map(markOf), [',', ',', ',', '.', '.', '.']);
  assert.deepEqual([textOf(9.5, speed, ','), endText(0.5, speed, ','), textOf(9.5, speed, '.')], ['9,5', '0,5', '9.5']);
  assert.deepEqual(readNumber(textOf(9.5, speed, ','), speed, ','), { value: 9.5 });
  assert.match(/** @type {any} */ (readNumber('90', speed, ',')).refused, /0,5 to 40 m\/s is allowed/);
  assert.deepEqual(['1,5', '1.5', ' 2 '].map((typed) => decimalOf(typed, ',')), [1.5, 1.5, 2]);
  assert.ok(['1.100', '', 'x', '1,2,3'].every((typed) => Number.isNaN(decimalOf(typed, ','))));
});

test('what cannot be set is refused with a text', () => {
  const why = (/** @type {string} */ typed) => /** @type {any} */ (readNumber(typed, speed)).refused;
  assert.equal(why(''), 'Speed limit: a number is required.');
  assert.equal(why('  '), 'Speed limit: a number is required.');
  for (const typed of ['abc', '1,000.5', '1.2.3', '1e3', 'NaN', 'Infinity', '--1', '0x10', '5 m', '<b>']) {
    assert.equal(why(typed), `Speed limit: “${typed}” is not a number.`);
  }
  for (const typed of ['0.4', '40.1', '-3', '99999999999999999999999']) assert.equal(why(typed), 'Speed limit: 0.5 to 40 m/s is allowed.', typed);
  chooseSpeedUnit('km/h');
  assert.equal(why('150'), 'Speed limit: 1.8 to 144 km/h is allowed.');
});

test('headings in the order of the server, each once', () => {
  assert.deepEqual(groupsOf(settings().schema).map(({ heading, names }) => [heading, names.length]), [['Speed', 1], ['Vehicle', 1], ['Expected rates', 1]]);
});

test('a search finds every term, in any order, whatever the case or accent', () => {
  const texts = [rate.title, rate.description, rate.heading, rate.unit];
  assert.ok(found('', texts) && found('  RATE speed ', texts) && found("car's hz", texts) && found('éxpected', texts));
  assert.ok(!found('rate laser', texts) && !found('<script>', texts) && !found('.*', texts));
});

test('a change back is what differs, and null where the default was in force', () => {
  const before = settings({ changed: [], values: { 'speed_limit.max_mps': 11, 'obstacle.wheelbase_m': 2.62 } });
  const after = settings({ topics: { speed: '/other' }, profile: { name: 'catvehicle', title: 'CATVehicle', chosen: 'catvehicle', recognised: 'Any car' } });
  assert.deepEqual(changeTo(after, before), { values: { 'speed_limit.max_mps': null }, topics: { speed: null }, profile: 'auto' });
  assert.deepEqual(changeTo(before, after), { values: { 'speed_limit.max_mps': 9 }, topics: { speed: '/other' }, profile: 'catvehicle' });
  assert.deepEqual(changeTo(after, after), {});
  assert.deepEqual(changeTo(after, DEFAULTS), changeTo(after, before));
});

test('a change as text', () => {
  const now = settings({ topics: { speed: '/other' } });
  assert.deepEqual(changeLines(now, { values: { 'speed_limit.max_mps': null }, topics: { speed: null }, profile: 'catvehicle' }, () => 'Speed'), [
    'Speed limit: 9.0 → 11.0 m/s', 'Topic of Speed: /other → chosen automatically', 'Kind of car: as recognised → CATVehicle',
  ]);
  assert.deepEqual(changeLines(now, { values: { 'gone.x': 1 } }, () => ''), []);
});

/** @returns {import('../../static/js/core/protocol-types.js').SignalState<any>} */
const signal = (more = {}) => ({
  label: 'Speed', freshness: 'fresh', age_s: 0.1, horizon_s: 1, period_s: 0.05, expected_hz: 20, rate_hz: 20, topic: '/vel', type: 'geometry_msgs/Twist', note: null,
  count: 9, rejected: 0, rejected_why: null, value: { speed_mps: 1 }, lowest: null, highest: null, ...more,
});

test('a topic shows what it carries, how fast, and what is wrong with it', () => {
  assert.deepEqual(topicWords(signal(), undefined, true), { topic: '/vel', detail: 'speed · Twist', icon: 'ok', rate: '20.0' });
  assert.deepEqual(topicWords(signal(), '/vel', true).detail, 'speed · Twist · chosen by you');
  assert.deepEqual(topicWords(signal({ note: 'Float64, expected Float32' }), undefined, true), { topic: '/vel', detail: 'speed · Twist\nFloat64, expected Float32', icon: 'warn', rate: '20.0' });
  assert.match(topicWords(signal({ rejected: 3, rejected_why: 'x is NaN' }), undefined, true).detail, /3 rejected: x is NaN/);
  assert.match(topicWords(signal({ freshness: 'stale', age_s: 7.4 }), undefined, true).detail, /silent for 7.4 s/);
  assert.match(topicWords(signal({ freshness: 'never' }), undefined, true).detail, /no message yet/);
  const empty = topicWords(signal({ freshness: 'not_measured', value: null, note: 'not measured (present is false)' }), undefined, true);
  assert.deepEqual([empty.detail, empty.icon], ['speed · Twist\nnot measured (present is false)', 'unknown']);
  const ghost = { freshness: /** @type {const} */ ('not_published'), note: 'no node publishes it', value: null };
  assert.deepEqual(topicWords(signal(ghost), undefined, true), { topic: '/vel', detail: 'speed · no node publishes it', icon: 'unknown', rate: '–' });
  assert.deepEqual(topicWords(signal(ghost), '/vel', true), { topic: '/vel', detail: 'speed · chosen by you, no node publishes it', icon: 'warn', rate: '–' });
  assert.deepEqual(topicWords(signal({ topic: null, type: null, value: null, freshness: 'not_published' }), undefined, true), { topic: 'Speed', detail: 'not published', icon: 'unknown', rate: '–' });
  assert.deepEqual(topicWords(signal({ topic: null, type: null, value: null }), '/gone', true), { topic: '/gone', detail: 'speed · chosen by you, but not published', icon: 'warn', rate: '–' });
  assert.deepEqual([topicWords(signal(), undefined, false).icon, topicWords(signal(), undefined, false).rate], ['unknown', '–']);
});

test('what can be picked: the own choice of the server, what is gone, what fits', () => {
  const fits = [{ topic: '/vel', type: 'T' }, { topic: '/odom', type: 'O' }];
  assert.deepEqual(optionsOf(fits, '/vel', undefined).map(({ topic, detail, isChosen }) => [topic, detail, isChosen]), [[null, 'now /vel', true], ['/vel', 'T · now', false], ['/odom', 'O', false]]);
  assert.deepEqual(optionsOf(fits, null, '/gone').map(({ topic, isChosen }) => [topic, isChosen]), [[null, false], ['/gone', true], ['/vel', false], ['/odom', false]]);
  assert.deepEqual(optionsOf(null, null, '/x').map(({ topic, detail }) => [topic, detail]), [[null, 'by type, publisher, namespace, frame and name'], ['/x', 'picked']]);
  assert.deepEqual(optionsOf([], null, undefined).map(({ detail }) => detail), ['no match now']);
});

test('a file that cannot hold settings is not sent', () => {
  assert.equal(fileProblem({ size: 10, name: 'a.toml' }), null);
  assert.equal(fileProblem({ size: 0, name: 'a.toml' }), '“a.toml” is empty.');
  assert.match(fileProblem({ size: 65537, name: 'x'.repeat(900) }) ?? '', /^“x{60}” is too large: .* 64 kB\.$/);
});

test('a trial of a sound names where this phone cannot sound', () => {
  assert.match(trialWords('missing', 'high'), /has no sound: this device sounds no alarms/);
  assert.match(trialWords('blocked', 'high'), /no alarm can be heard/);
  assert.match(trialWords('busy', 'low'), /An alarm sounds now/);
  assert.match(trialWords('sounding', 'medium'), /three rising pulses/);
});
