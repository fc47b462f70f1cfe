// How recordings read in the list.

import assert from 'node:assert/strict';
import { test } from 'node:test';

import {
  alarmWords, byUrgency, choiceOf, countsOf, distanceWords, factWords, lengthWords, liveOf, matchWords, nameOf, originWords, pointsOf, queryOf, sizeWords, storedWords, tagsOf, warningWords, whenWords, whyNotAsItIs,
} from '../../static/js/files/files-layout.js';
import { listingOf, storedQueryOf } from '../../static/js/files/stored-list.js';

const NOW = new Date(2026, 10, 21, 15, 0).getTime();
const row = (more = {}) => /** @type {import('../../static/js/files/files-layout.js').Recording} */ ({
  id: 'car_1', vehicle: 'car', session: null, part: 1, started_ms: NOW - 3_600_000, length_s: 512.4, size_bytes: 38_000_000, distance_m: 1302, top_speed_mps: 12.64,
  alarms: { critical: 2, warning: 1, advisory: 0 }, title: '', note: '', tags: [], state: 'read', problem: null, damage: [], ended: 'closed', ended_why: null,
  is_clip: false, file: 'car_1.mcap', format: 'mcap', sketch: null, trashed_ms: null, ...more,
});

test('a time is that of this phone, and a day is named as people do', () => {
  const at = (/** @type {number[]} */ ...parts) => whenWords(new Date(.../** @type {[number, number]} */ (/** @type {unknown} */ (parts))).getTime(), NOW);
  assert.equal(at(2026, 10, 21, 0, 0), 'Today 00:00');
  assert.equal(at(2026, 10, 20, 23, 59), 'Yesterday 23:59');
  assert.equal(at(2026, 10, 19, 14, 5), '19 Nov 14:05');
  assert.equal(at(2025, 11, 31, 9, 7), '31 Dec 2025 09:07');
  assert.equal(whenWords(new Date(2026, 0, 1, 8, 0).getTime(), new Date(2026, 0, 2, 0, 1).getTime()), 'Yesterday 08:00');
  assert.equal(whenWords(NaN, NOW), '–');
});

test('sizes have three figures at most and a unit that fits', () => {
  const cases = /** @type {[number | null, string][]} */ ([
    [0, '0 B'], [-5, '0 B'], [940, '940 B'], [1500, '1.5 kB'], [18_400, '18 kB'], [999_400, '999 kB'], [999_600, '1.0 MB'], [18_600_000, '18.6 MB'], [138_000_000, '138 MB'],
    [1_900_000_000, '1.9 GB'], [41_000_000_000, '41.0 GB'], [2_500_000_000_000, '2.5 TB'], [null, '–'],
  ]);
  for (const [bytes, text] of cases) assert.equal(sizeWords(bytes), text);
});

test('a row that a search found by a mark names the mark', () => {
  const mark = { mark: 'm1', marked_ms: NOW - 3_300_000, category: 'control', words: 'twice', voice: false, photo: false, source: 'page', by: null };
  assert.equal(matchWords(row({ matched: { ...mark, at_s: 246.2 } })), 'Mark at 04:06: control · twice');
  assert.equal(matchWords(row({ matched: { ...mark, category: null } })), 'Mark at 05:00: twice', 'one that came later has the time of its moment');
  assert.equal(matchWords(row()), '');
  const words = 'Box behind the corner, then the car creeps over the stop line and waits';
  const of = (/** @type {string} */ text, more = {}) => matchWords(row({ matched: { ...mark, words, at_s: 246.2, ...more } }), text);
  assert.equal(of(' STOP line'), 'Mark at 04:06: control · …over the stop line and waits', 'a late match is seen on a narrow phone');
  assert.equal(of('corner'), `Mark at 04:06: control · ${words}`);
  assert.equal(of('control'), `Mark at 04:06: control · ${words}`, 'found in the category');
  assert.equal(of('stop', { words: `${'x'.repeat(50)}stop` }), `Mark at 04:06: control · …${'x'.repeat(20)}stop`, 'without a space before it');
});

test('lengths and distances', () => {
  assert.equal(lengthWords(252), '04:12 min');
  assert.equal(lengthWords(3725), '1:02:05 h');
  assert.equal(lengthWords(0), '00:00 min');
  assert.equal(lengthWords(null), '–');
  assert.equal(distanceWords(75.7), '76 m');
  assert.equal(distanceWords(1302), '1.3 km');
});

test('no alarms is not the same as no alarms recorded', () => {
  assert.equal(alarmWords(row().alarms), '2 critical alarms, 1 warning');
  assert.equal(alarmWords({ critical: 0, warning: 0, advisory: 2 }), '2 advisories');
  assert.equal(alarmWords({ critical: 0, warning: 0, advisory: 0 }), 'no alarms');
  assert.equal(alarmWords(null), 'alarms not recorded');
  assert.deepEqual(countsOf(null), []);
});

test('what a recording is called, and what stands beneath', () => {
  assert.equal(nameOf(row(), NOW), 'Today 14:00');
  assert.equal(originWords(row(), NOW), 'car');
  assert.equal(nameOf(row({ title: 'Wet lot' }), NOW), 'Wet lot');
  assert.equal(originWords(row({ title: 'Wet lot', part: 2, ended: 'recovered', is_clip: true }), NOW), 'car · clip · part 2 · recovered');
  assert.equal(originWords(row({ format: 'bag', vehicle: '', damage: ['x'] }), NOW), 'ROS 1 bag · damaged');
  assert.equal(originWords(row({ unread: ['x'] }), NOW), 'car', 'what cannot be decoded is not damaged');
  assert.equal(originWords(row({ trashed_ms: NOW - 60_000 }), NOW), 'car · deleted Today 14:59');
});

test('a recording of several files is not offered as it is', () => {
  assert.equal(whyNotAsItIs(row()), '');
  assert.equal(whyNotAsItIs(row({ several_files: null })), '');
  assert.equal(whyNotAsItIs(row({ format: 'folder', several_files: 'a folder of several files' })), 'It is a folder of several files: as it is, copy it from the server’s disk.');
});

test('the facts in one sentence, and what is unknown as unknown', () => {
  assert.equal(factWords(row()), '08:32 min, 38.0 MB, 1.3 km, up to 12.6\u00a0m/s, 2 critical alarms, 1 warning.');
  assert.equal(factWords(row({ distance_m: null, top_speed_mps: null, alarms: null })), '08:32 min, 38.0 MB, no position, alarms not recorded.');
  assert.equal(factWords(row({ state: 'waiting', length_s: null })), '38.0 MB, being read.');
  assert.equal(factWords(row({ state: 'unreadable', problem: 'x.mcap is empty.' })), '38.0 MB. x.mcap is empty.');
  assert.deepEqual(warningWords(row({ ended: 'recovered', ended_why: 'the server was killed.', damage: ['A part is lost.'] })), ['Recovered: the server was killed.', 'A part is lost.']);
  assert.deepEqual(warningWords(row({ ended: 'recovered', ended_why: 'car_1 was recovered.', left_out: ['/camera', '/points'] })), ['car_1 was recovered.', 'Not recorded: /camera, /points.']);
  assert.deepEqual(warningWords(row({ unread: ['/points (7 messages) is left out: messages encoded as \'protobuf\' are not supported.'] })), ['/points (7 messages) is left out: messages encoded as \'protobuf\' are not supported.']);
  assert.deepEqual(warningWords(row({ not_received: ['/imu'] })), ['No messages from: /imu.']);
  assert.deepEqual(warningWords(row({ left_out: ['/camera', '/points'], left_out_count: 9 })), ['Not recorded: /camera, /points and 7 more.']);
  assert.deepEqual(warningWords(row({ ended: 'recovered' })), ['Recovered: the server stopped during the recording.']);
  assert.deepEqual(warningWords(row()), []);
});

test('the query to the server', () => {
  const query = (/** @type {string} */ choice, text = '') => Object.fromEntries(new URLSearchParams(queryOf({ text, choice: choiceOf(choice), limit: 50 }, NOW)));
  assert.deepEqual(query('all', '  wet  '), { limit: '50', text: 'wet' });
  assert.deepEqual(query('vehicle:a:b&c'), { limit: '50', vehicle: 'a:b&c' });
  assert.deepEqual(query('tag:lot 3'), { limit: '50', tag: 'lot 3' });
  assert.deepEqual(query('days:1'), { limit: '50', since_ms: String(new Date(2026, 10, 21).getTime()) });
  assert.deepEqual(query('nonsense'), { limit: '50' });
});

test('tags as they are typed, points as they are drawn', () => {
  assert.deepEqual(tagsOf(' wet, lot 3;;\nnight ,'), ['wet', 'lot 3', 'night']);
  assert.deepEqual(tagsOf(''), []);
  assert.equal(pointsOf([1, 2.5, 3, 4]), '1,2.5 3,4');
});

test('what is recorded now, and why nothing is', () => {
  const now = { vehicle: 'car', isMonitoring: true, isSilent: false };
  const on = { state: 'recording', for_s: 252, part: 1, bytes: 18_600_000, dropped: 0, reason: null };
  assert.deepEqual(liveOf(on, now), { name: 'Recording now', mark: 'car', length: '04:12 min', size: '18.6 MB', lost: '', missing: '', isOn: true, isBad: false, order: false });
  assert.equal(liveOf({ ...on, part: 2 }, now)?.mark, 'car · part 2');
  assert.equal(liveOf({ ...on, dropped: 7 }, now)?.lost, '7 messages lost: the disk is too slow');
  assert.equal(liveOf({ ...on, dropped: 7 }, now)?.isBad, true);
  const held = liveOf({ ...on, state: 'held', reason: 'The link is lost.' }, now);
  assert.deepEqual([held?.name, held?.mark, held?.isOn, held?.order], ['Recording held', 'The link is lost.', false, false]);
  const stopped = liveOf({ ...on, state: 'stopped', reason: 'The disk is full.' }, now);
  assert.deepEqual([stopped?.name, stopped?.mark, stopped?.isBad, stopped?.order], ['Recording stopped', 'The disk is full.', true, true]);
  assert.equal(liveOf({ ...on, state: 'saving' }, now)?.order, null);
  const off = { state: 'off', for_s: null, reason: 'Recording starts manually (a setting).' };
  assert.deepEqual([liveOf(off, now)?.name, liveOf(off, now)?.order, liveOf(off, now)?.length, liveOf(off, now)?.size], ['Not recording', true, '', '']);
  assert.equal(liveOf(off, { ...now, isMonitoring: false }), null);
  assert.equal(liveOf(undefined, now), null);
  assert.equal(liveOf(on, { ...now, isSilent: true })?.isOn, false, 'nobody knows');
  const missing = { left_out: ['/points', '/camera'], too_large: [{ topic: '/camera', mb: 40.2 }], not_received: ['/imu', '/names'], as_json: 3 };
  assert.equal(liveOf({ ...on, ...missing }, now)?.missing, 'Not recorded: /points. Too large to record: /camera (40 MB a message). No messages from: /imu, /names. '
    + '3 messages stored as JSON: their type definition is unknown or does not match.');
  assert.equal(liveOf({ ...off, ...missing }, now)?.missing, '');
  const many = { left_out: ['/points', '/camera'], left_out_count: 9, too_large: [{ topic: '/camera', mb: 40.2 }], too_large_count: 1, not_received: ['/imu'], not_received_count: 2 };
  assert.equal(liveOf({ ...on, ...many }, now)?.missing, 'Not recorded: /points and 7 more. Too large to record: /camera (40 MB a message). No messages from: /imu and 1 more.');
});

test('where the copy of a recording is', () => {
  const stored = (/** @type {object} */ more) => storedWords(/** @type {any} */ ({ state: 'none', share: null, checked_ms: null, sentence: '', clips: 0, is_asked: false, is_deletion_asked: false, ...more }));
  assert.equal(storedWords(undefined), '');
  assert.equal(stored({ sentence: 'The whole file is uploaded on request.' }), 'not stored');
  assert.equal(stored({ state: 'waiting' }), 'not stored, waits for its upload');
  assert.equal(stored({ state: 'uploading', share: 0.999 }), 'uploading 99 %');
  assert.equal(stored({ state: 'stored', checked_ms: new Date(2026, 10, 21, 14, 3).getTime() }), 'stored (checked 14:03)');
  assert.equal(stored({ state: 'stored', checked_ms: new Date(2026, 10, 21, 14, 3).getTime(), sentence: 'The file changed after it was uploaded.' }), 'stored (checked 14:03). Failed since: The file changed after it was uploaded.');
  assert.equal(stored({ state: 'failed', sentence: 'The store x is full.' }), 'not stored, failed: The store x is full.');
});

test('what agents stored is listed as recordings are', () => {
  const of = /** @type {any} */ ({ id: 'a_1', vehicle: 'a', folder: 'a', title: '', started_ms: NOW, length_s: 3, distance_m: null, top_speed_mps: null, alarms: null, sketch: null, file: null, size_bytes: null, sha256: null, checked_ms: null, clips: [] });
  const listing = listingOf({ store: 's3://b', recordings: [of, { ...of, id: 'a_2', file: 'a_2.mcap', size_bytes: 5, checked_ms: NOW }], next: 'a/a_2', count: 7 }, null);
  assert.deepEqual(listing.recordings.map(({ id, size_bytes, stored }) => [id, sizeWords(size_bytes), storedWords(stored).slice(0, 10)]), [['a_1', '–', 'not stored'], ['a_2', '5 B', 'stored (ch']]);
  assert.deepEqual([listing.next, listing.all.count], ['a/a_2', 7]);
  assert.equal(storedQueryOf(null, 5, { kind: 'all', value: '' }, 'b'), 'limit=5&vehicle=b');
  assert.equal(storedQueryOf('a/a_2', 200, { kind: 'vehicle', value: 'a b' }), 'limit=100&cursor=a%2Fa_2&vehicle=a+b');
});

test('of a short list of alarms the criticals come first, and each priority in the order of time', () => {
  const one = (/** @type {number} */ at_ms, /** @type {'critical' | 'warning' | 'advisory'} */ priority) => ({ at_ms, priority });
  assert.deepEqual(byUrgency([one(1, 'warning'), one(2, 'advisory'), one(3, 'critical'), one(4, 'warning'), one(5, 'critical')]).map(({ at_ms }) => at_ms), [3, 5, 1, 4, 2]);
});
