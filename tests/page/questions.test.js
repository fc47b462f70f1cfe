import assert from 'node:assert/strict';
import { test } from 'node:test';
import { withQuestion } from '../../static/js/core/freshness.js';
import { isAbsent } from '../../static/js/core/ink.js';
import { otherWords } from '../../static/js/home/signal-more.js';
import { kindWords } from '../../static/js/home/signals.js';
import { joinedChoices } from '../../static/js/replay/replay-layout.js';
import { isOfMounting, lacksBumper } from '../../static/js/scan/scan-readout.js';
import { answerOf, dealt, keyOf, mayAnswer, meanwhileWords, restWords, waitingWords } from '../../static/js/settings/question-layout.js';
import { pointsOf, reachOf, sketchedOf } from '../../static/js/settings/scan-sketch.js';
import { changeLines, changeTo, DEFAULTS } from '../../static/js/settings/settings-layout.js';
import { topicWords } from '../../static/js/settings/settings-topics.js';

/** @returns {import('../../static/js/core/protocol-types.js').Question} */
const question = (more = {}) => ({ signal: 'scan', kind: 'source', words: 'Two lasers: which one faces forward?', options: [{ value: '/a', label: '/a', why: '' }, { value: '/b', label: '/b', why: '' }], options_count: 2, ...more });
const brake = question({ signal: 'brake', kind: 'unit' });
const none = { ink: /** @type {const} */ ('not_published'), age_s: null };

test('a value that is missing because a question stands is shown as that, and no other', () => {
  assert.equal(withQuestion(none, 'scan', [question()]).ink, 'not_chosen');
  assert.equal(withQuestion({ ink: 'no_value', age_s: null }, 'brake', [brake]).ink, 'not_in_unit');
  assert.equal(withQuestion(none, 'speed', [question(), brake]).ink, 'not_published');
  assert.deepEqual([withQuestion(none, 'scan', []).ink, withQuestion(none, 'scan', undefined).ink], ['not_published', 'not_published']);
  assert.equal(withQuestion({ ink: 'stale', age_s: 9 }, 'scan', [question()]).ink, 'stale'); // it has a value
  assert.ok(isAbsent('not_chosen') && isAbsent('not_in_unit'));
});

test('who is in control answers, or the first to act where nobody is', () => {
  const control = (/** @type {object} */ more) => /** @type {any} */ ({ holder: 'Pixel 8', page: 'p', ...more });
  assert.equal(mayAnswer({ isViewer: false, page: 'p', control: control({}) }), true);
  assert.equal(mayAnswer({ isViewer: false, page: 'q', control: control({}) }), false);
  assert.equal(mayAnswer({ isViewer: false, page: 'q', control: control({ holder: null, page: null }) }), true);
  assert.equal(mayAnswer({ isViewer: true, page: 'q', control: control({ holder: null, page: null }) }), false);
  assert.equal(mayAnswer({ isViewer: false, page: '', control: control({ page: '' }) }), false);
  assert.equal(mayAnswer({ isViewer: false, page: 'p', control: null }), false); // who is in control is not received yet
});

test('what is put off waits, also with other options, and for another car it is shown', () => {
  const later = new Set([keyOf('car', question())]);
  const more = question({ options: [], options_count: 3 });
  assert.deepEqual(dealt('car', [more, brake], later), { open: [brake], waiting: [more] });
  assert.deepEqual(dealt('van', [more, brake], later).open, [more, brake]);
  assert.equal(waitingWords([question(), brake], (name) => name.toUpperCase()), 'Not chosen: SCAN, unit of BRAKE');
  assert.match(waitingWords([1, 2, 3, 4, 5].map((n) => question({ signal: `s${n}` })), (name) => name), /s1, s2, s3 and 2 more$/);
});

test('an answer is a topic or a unit of its signal, and what is not listed is counted', () => {
  assert.deepEqual(answerOf(question(), '/b'), { topics: { scan: '/b' } });
  assert.deepEqual(answerOf(brake, 'share'), { units: { brake: 'share' } });
  assert.equal(restWords(question()), '');
  assert.match(restWords(question({ options_count: 500 })), /^500 candidates in all; the 2 most probable/);
});

test('ahead is up and left is left in a drawing, and all drawings have one reach', () => {
  const quarter = Math.PI / 2;
  const scan = { ranges_m: [4, null, 5, 30], angle_min_rad: 0, angle_increment_rad: quarter };
  const [ahead, back] = pointsOf(scan, 10);
  assert.ok(ahead && Math.abs(ahead[0]) < 1e-9 && ahead[1] < 0, String(ahead));
  assert.ok(back && back[1] > 0, String(back));
  assert.equal(pointsOf(scan, 10).length, 2); // what is unknown or beyond is no point
  const [left] = pointsOf({ ranges_m: [4], angle_min_rad: quarter, angle_increment_rad: 0.1 }, 10);
  assert.ok(left && left[0] < 0, String(left));
  assert.deepEqual([reachOf([]), reachOf([{ ...scan, ranges_m: [1, 2, 3] }]), reachOf([{ ...scan, ranges_m: [1, 9, 300] }, { ...scan, ranges_m: [12, 18, 19] }])], [5, 5, 20]);
});

test('an offer without a scan that can be drawn has no drawing', () => {
  const offer = { topic: '/a', type: 'T', ranges_m: [1, null, NaN, -1, 'x'], angle_min_rad: 0, angle_increment_rad: 0.1 };
  assert.deepEqual(sketchedOf(offer)?.ranges_m, [1, null, null, null, null]);
  for (const bad of [null, undefined, {}, { ...offer, ranges_m: [] }, { ...offer, ranges_m: 3 }, { ...offer, angle_min_rad: null }, { ...offer, angle_increment_rad: undefined }]) assert.equal(sketchedOf(bad), null);
});

test('a chosen unit is taken back as a topic is, and named as it is read', () => {
  const now = /** @type {any} */ ({ values: {}, changed: [], defaults: {}, schema: {}, topics: { scan: '/a' }, units: { brake: 'share' }, unit_choices: { brake: [{ name: 'share', label: '0 to 1' }] }, profile: { chosen: 'auto' }, profiles: [] });
  assert.deepEqual(changeTo(now, DEFAULTS), { topics: { scan: null }, units: { brake: null } });
  assert.deepEqual(changeTo(now, now), {});
  assert.deepEqual(changeLines(now, { units: { brake: null } }, () => 'Brake'), ['Unit of Brake: 0 to 1 → as found']);
  assert.deepEqual(changeLines({ ...now, units: {} }, { units: { brake: 'share' } }, () => 'Brake'), ['Unit of Brake: as found → 0 to 1']);
});

test('what else could carry a signal stands without the one that does, and not endlessly', () => {
  const offers = [{ topic: '/a', type: 'T' }, { topic: '/b', type: 'T', frame: 'rear', why: 'no publisher' }];
  assert.deepEqual(otherWords(offers, '/a'), [{ topic: '/b', detail: 'T\nframe rear\nno publisher' }]);
  assert.deepEqual(otherWords(null, '/a'), []);
  const many = otherWords(Array.from({ length: 500 }, (_, i) => ({ topic: `/t${i}`, type: 'T' })), '/t0');
  assert.deepEqual([many.length, many.at(-1)?.topic], [7, 'and 493 more']);
});

test('what holds meanwhile is a sentence', () => {
  const words = (/** @type {any} */ kind, /** @type {string} */ label) => meanwhileWords(/** @type {any} */ ({ kind }), label);
  assert.equal(words('source', 'Laser'), 'The laser is not used until one is chosen.');
  assert.equal(words('unit', 'GPS fix'), 'The GPS fix is not used until its unit is known.');
});

test('the list of signals and Settings say that a source is not chosen', () => {
  const signal = /** @type {any} */ ({ label: 'Laser', topic: null, type: null, value: null, freshness: 'not_published', note: null });
  assert.equal(kindWords(signal, 'not_chosen'), 'press to choose');
  assert.equal(kindWords(signal), 'no such topic');
  assert.deepEqual([topicWords(signal, undefined, true, true).detail, topicWords(signal, undefined, true, true).icon], ['not chosen: press to choose', 'warn']);
});

test('a note on the mounting leads to its settings', () => {
  for (const note of ['mounting not known: no transform', 'assumed to look ahead: no transforms, and no setting']) assert.ok(isOfMounting(note), note);
  for (const note of ['', 'not a number (ranges)']) assert.ok(!isOfMounting(note) && !lacksBumper(note), note);
  const noBumper = "gap from the laser: no bumper set; by the car's transforms looking ahead, 0.30 m ahead of base_link";
  assert.deepEqual([isOfMounting(noBumper), lacksBumper(noBumper)], [false, true]);
});

test('a replay is of this page alone: who is in control of the car does not matter', () => {
  const control = /** @type {any} */ ({ holder: 'Pixel 8', page: 'p' });
  assert.equal(mayAnswer({ isViewer: false, page: 'q', control, replaying: true }), true);
  assert.equal(mayAnswer({ isViewer: true, page: 'q', control, replaying: true }), false);
});

test('a choice for a replay is added to those before, and one that is taken back is none', () => {
  const first = joinedChoices({ topics: {}, units: {} }, { topics: { scan: '/front' } });
  const second = joinedChoices(first, { units: { brake: 'share' }, topics: { speed: '/odom' } });
  assert.deepEqual(second, { topics: { scan: '/front', speed: '/odom' }, units: { brake: 'share' } });
  assert.deepEqual(joinedChoices(second, { topics: { scan: null } }), { topics: { speed: '/odom' }, units: { brake: 'share' } });
});
