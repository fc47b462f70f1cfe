// The chart of a drive: views, cuts, what stands at the cursor, ticks and the table.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { brushPath, clockWords, csvOf, extentOf, foundAt, foundWords, limitAt, lineOf, placedMarks, roundEnds, specFor, tagAt, valueTicks, viewAfter, wholeLabel, within } from '../../static/js/home/drive-layout.js';
import { DriveView, emptyWords, stateWords } from '../../static/js/home/drive-view.js';
import { withFirst } from '../../static/js/home/drive-choice.js';
import { marginOf, roomFor } from '../../static/js/home/pane-stack.js';

const BUCKETS = { from_s: 10, step_s: 2 };

/** @param {(number | null)[]} numbers @param {Partial<import('../../static/js/home/drive-layout.js').Trend>} [more] */
function trend(numbers, more = {}) {
  return { lowest: numbers, highest: numbers.map((one) => (one === null ? null : one + 1)), gaps: [], none: [], limits: [], ...more };
}

test('a view is zoomed about a place, moved, and never leaves the drive', () => {
  assert.deepEqual(viewAfter([100, 200], { zoom: 0.5, about: 0.25 }, 1000), [112.5, 162.5]);
  assert.deepEqual(viewAfter([100, 200], { zoom: 0.01, about: 1 }, 1000), [190, 200]); // ten seconds at least
  assert.deepEqual(viewAfter([100, 200], { zoom: 99 }, 1000), [0, 1000]);
  assert.deepEqual(viewAfter([100, 200], { pan: 0.5 }, 1000), [150, 250]);
  assert.deepEqual(viewAfter([100, 200], { pan: -2 }, 1000), [0, 100]);
  assert.deepEqual(viewAfter([900, 1000], { pan: 3 }, 1000), [900, 1000]);
  assert.deepEqual(within([-20, 40], 30), [-30, 30]); // a drive that is shorter than its view ends at the right edge
});

test('a line passes over buckets without a message, and is cut where a gap or no number lies between', () => {
  assert.deepEqual(lineOf(trend([1, null, 3]), BUCKETS), { times_s: [11, 15], lowest: [1, 3], highest: [2, 4] });
  assert.deepEqual(lineOf(trend([1, null, 3], { gaps: [[11.5, 14]] }), BUCKETS).lowest, [1, null, 3]);
  assert.deepEqual(lineOf(trend([1, 2, 3], { none: [[13.5, 13.6]] }), BUCKETS).lowest, [1, 2, null, 3]);
  assert.deepEqual(lineOf(trend([1, 2, 3], { gaps: [[0, 10]], none: [[16, 20]] }), BUCKETS).lowest, [1, 2, 3]);
  assert.deepEqual(lineOf(trend([null, null]), BUCKETS).times_s, []);
});

test('the extent is that of what is in view', () => {
  assert.deepEqual(extentOf(trend([1, 9, 3, 20]), BUCKETS, [12.5, 15]), [3, 10]);
  assert.equal(extentOf(trend([1, null, 3]), BUCKETS, [12.1, 13.9]), null);
});

test('a value is found at the cursor, and none across a gap', () => {
  const silent = trend([1, 2, null, null, 5], { gaps: [[14.5, 18]] });
  assert.deepEqual(foundAt(silent, BUCKETS, 12.5), { kind: 'value', low: 2, high: 3 });
  assert.deepEqual(foundAt(silent, BUCKETS, 16), { kind: 'gap' });
  assert.deepEqual(foundAt(trend([1, null, 3]), BUCKETS, 12.5), { kind: 'value', low: 1, high: 2 }); // of the bucket beside it
  assert.deepEqual(foundAt(trend([1, null, null], { none: [[12, 16]] }), BUCKETS, 15), { kind: 'none' });
  assert.deepEqual(foundAt(trend([1]), BUCKETS, 99), { kind: 'unknown' });
});

test('the found value as text, with its sign and both ends of a bucket', () => {
  assert.equal(foundWords({ kind: 'value', low: 3.04, high: 3.04 }, specFor('speed', undefined)), '3.0');
  assert.equal(foundWords({ kind: 'value', low: -4, high: 2 }, specFor('steering', undefined)), '−4 to +2');
  assert.equal(foundWords({ kind: 'none' }, specFor('distance', undefined)), 'none in range');
  assert.equal(foundWords({ kind: 'gap' }, specFor('speed', undefined)), 'no data');
});

test('a signal without a place on Home stands between round ends', () => {
  const spec = specFor('position', { label: 'Altitude', unit: 'm' });
  assert.equal(spec.label, 'Altitude');
  assert.deepEqual(spec.ends({}, 746.4, 751.2), [746, 752]);
  assert.deepEqual(roundEnds(5, 5), [5, 6]);
  assert.deepEqual(roundEnds(-12, 340), [-100, 400]);
});

test('the limit at a moment', () => {
  assert.equal(limitAt([[0, 11], [60, 9]], 59), 11);
  assert.equal(limitAt([[0, 11], [60, 9]], 60), 9);
  assert.equal(limitAt([], 60), null);
});

test('marks that would cover each other are one, with the shape and the place of the most urgent; advisories have none', () => {
  const mark = (/** @type {number} */ at_s, /** @type {any} */ priority) => ({ at_s, priority, title: `${priority} ${at_s}`, alarm: 'x' });
  const placed = placedMarks([mark(5, 'critical'), mark(20, 'warning'), mark(21, 'critical'), mark(50, 'advisory'), mark(80, 'warning')], [10, 110], 300);
  assert.deepEqual(placed.map(({ x, at_s, count, priority }) => [x, at_s, count, priority]), [[33, 21, 2, 'critical'], [210, 80, 1, 'warning']]);
});

test('ticks have seconds where they are less than a minute apart', () => {
  const at_s = new Date(2026, 10, 19, 14, 7, 30).getTime() / 1000;
  assert.equal(clockWords(at_s, 30), '14:07:30');
  assert.equal(clockWords(at_s, 60), '14:07');
});

test('a tick at the right end has no label that the edge would cut', () => {
  const shown = (/** @type {number} */ x_px) => ['17:20', '17:20:15'].map((text) => wholeLabel(text, x_px, 212));
  assert.deepEqual([shown(150), shown(185), shown(200)], [['17:20', '17:20:15'], ['17:20', ''], ['', '']]);
});

test('values have round ticks, and in a low pane those of the ends', () => {
  assert.deepEqual(valueTicks(-50, 50, 25, false), [-50, -25, 0, 25, 50]);
  assert.deepEqual(valueTicks(1, 15, 5, false), [5, 10, 15]);
  assert.deepEqual(valueTicks(-50, 47, 25, true), [-50, 47]);
});

test('the strip is cut at gaps', () => {
  assert.equal(brushPath(trend([1, 2, null, 4], { gaps: [[14, 16]] }), { from_s: 0, step_s: 5 }, 20, 200, 0, 10).match(/M/g)?.length, 2);
});

test('a table has one line a bucket in view, and empty fields where there is no number', () => {
  const answer = /** @type {any} */ ({ start_ms: Date.UTC(2026, 10, 19, 14), from_s: 10, step_s: 2, signals: { speed: trend([1, null, 3, 4]) } });
  assert.equal(csvOf(answer, [specFor('speed', undefined)], [12.5, 15]), [
    'time_utc,seconds,Speed lowest [m/s],Speed highest [m/s]', '2026-11-19T14:00:12.000Z,12.00,,', '2026-11-19T14:00:14.000Z,14.00,3,4', '',
  ].join('\r\n'));
  assert.match(csvOf(answer, [specFor('steering', undefined)], [0, 99]), /"Steering, negative is left lowest \[%\]"/);
});

test('a signal that is opened comes first, and the last gives way', () => {
  assert.deepEqual(withFirst(['speed', 'brake', 'steering', 'distance'], 'heading'), ['heading', 'speed', 'brake', 'steering']);
  assert.deepEqual(withFirst(['speed', 'brake'], 'brake'), ['brake', 'speed']);
});

test('a live chart goes on with the drive, and is held once it was moved away', () => {
  const scope = new DriveView();
  scope.keepUp(1000, undefined);
  assert.deepEqual(scope.view, [640, 1000]);
  scope.set([600, 960], 1000, false);
  assert.equal(scope.follows, false);
  scope.keepUp(1005, undefined);
  assert.deepEqual(scope.view, [600, 960]);
  scope.set([644, 1004], 1005, false); // the right edge is reached again, but for a pixel
  assert.equal(scope.follows, true);
  scope.follow(Infinity);
  scope.keepUp(1010, undefined);
  assert.deepEqual(scope.view, [0, 1010]);
  scope.follow(60);
  scope.keepUp(30, undefined);
  assert.deepEqual(scope.view, [-30, 30]);
});

test('the chart of a replay stays where the moment is, and turns to it when it leaves', () => {
  const scope = new DriveView();
  scope.keepUp(3600, { at_s: 600 });
  assert.deepEqual(scope.view, [420, 780]);
  scope.keepUp(3600, { at_s: 779 });
  assert.deepEqual(scope.view, [420, 780]);
  scope.keepUp(3600, { at_s: 790 });
  assert.deepEqual(scope.view, [610, 970]);
  scope.keepUp(3600, { at_s: 3590 });
  assert.deepEqual(scope.view, [3240, 3600]); // the right edge is the end of the recording
  scope.set([0, 100], 3600, true);
  scope.keepUp(3600, { at_s: 3590 });
  assert.deepEqual(scope.view, [0, 100]);
});

test('what is not live, or not all of it, is shown', () => {
  const answer = /** @type {any} */ ({ start_ms: new Date(2026, 10, 19, 14).getTime(), known_s: 90, length_s: 90, is_sketch: false, signals: {}, offered: {} });
  const text = (/** @type {any} */ feed, /** @type {boolean} */ follows, /** @type {boolean} */ isReplay) => stateWords({ answer, isLate: false, ...feed }, [0, 60], follows, isReplay);
  assert.equal(text({}, true, false), '');
  assert.equal(text({}, false, false), 'Held at 14:01:00: not live');
  assert.equal(text({ isLate: true }, true, false), 'No answer since 14:01:30');
  assert.equal(text({ isLate: true }, false, true), '');
  assert.equal(text({ answer: { ...answer, length_s: 900 } }, true, true), 'Read up to 14:01:30');
  assert.match(text({ answer: { ...answer, is_sketch: true } }, true, true), /^Sketch/);
  assert.equal(text({ answer: null }, true, false), 'Loading…');
});

test('an empty chart shows what would fill it', () => {
  const of = (/** @type {boolean[]} */ ...has) => /** @type {any} */ ({
    signals: Object.fromEntries(has.map((_, i) => [`s${i}`, {}])), offered: Object.fromEntries(has.map((one, i) => [`s${i}`, { label: `S${i}`, unit: '', has_data: one }])),
  });
  assert.equal(emptyWords(of(false, false), false), 'No S0, S1 yet. The first message draws it; Settings has its topic.');
  assert.equal(emptyWords(of(false), true), 'The recording holds no S0. Choose another signal.');
  assert.equal(emptyWords(of(false, true), false), '');
  assert.equal(emptyWords(of(), false), '');
});

test('the tag of the cursor stands beside it where it would cover the mark of an alarm', () => {
  const sizes = { left: 10, right: 410, width: 84, mark: 24 };
  assert.equal(tagAt(200, [], sizes), 158);
  assert.equal(tagAt(200, [120], sizes), 158, 'a mark far away');
  assert.equal(tagAt(200, [200], sizes), 212, 'at the right of the mark beneath the cursor');
  assert.equal(tagAt(200, [200, 240], sizes), 104, 'else at its left');
  assert.equal(tagAt(200, [147, 208], sizes), 220, 'and where both are taken, behind the mark that is nearer');
  assert.equal(tagAt(400, [400], sizes), 304, 'inside of the chart');
  assert.equal(tagAt(200, [140, 216], sizes, [216]), 120, 'else a warning is covered, and no critical alarm');
  const everywhere = Array.from({ length: 32 }, (_, i) => 22 + 24 * i); // but for the right end
  const at = tagAt(200, everywhere, { ...sizes, right: 1010 });
  assert.ok(Math.max(at - 200, 200 - at - 84) <= 24, `among many marks it stays at its cursor, not at ${at}`);
});

test('a flat plot has one number beside it, a higher one those at both ends', () => {
  assert.deepEqual(roomFor([0, 20], 25), [20]);
  assert.deepEqual(roomFor([0, 20], 60), [0, 20]);
  assert.ok(marginOf(25) < marginOf(60));
  // what has one tick is flat for its margins too
  for (const height of [30, 39, 40, 41, 60]) assert.equal(marginOf(height) === marginOf(25), roomFor([0, 20], height).length === 1);
});
