import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Store } from '../../static/js/core/store.js';
import { badgeOf } from '../../static/js/shell/badge.js';
import { dialogOf } from '../../static/js/shell/dialogs.js';
import { chainOf } from '../../static/js/core/link.js';
import { Track } from '../../static/js/map/map-track.js';
import { readMessage } from '../../static/js/core/protocol.js';
import { asideOf, atByKey, atOf, BASE, clockOf, countWords, gapBands, liveWords, manualBands, markBeside, markPath, momentOf, placed, rateWords, sketchOf, speedPath, spoken, summaryOf, xOf } from '../../static/js/replay/replay-layout.js';
import { LEAD_S, jumpAt, jumpWords, jumpsOf, lengthOfJump, nearestJump } from '../../static/js/replay/replay-jumps-layout.js';
import { alarm, state } from './frames.js';

const mark = (at_s, more = {}) => ({ at_s, alarm: 'speed_limit', title: 'Speed above limit', priority: /** @type {const} */ ('critical'), text: '', duration_s: null, ...more });
const replay = (more = {}) => ({
  id: 'r', vehicle: 'car', title: '', token: 't', at_s: 246, at_ms: 1_790_000_000_000, start_ms: 0, end_ms: 0, length_s: 512, is_playing: false, rate: 1, reached_rate: null,
  is_seeking: false, is_settled: true, silent_s: 0, seek: 1, alarms_from: /** @type {const} */ ('judged'), settings_from: /** @type {const} */ ('now'), hangs_s: null, ...more,
});
const live = (more = {}) => ({ phase: /** @type {const} */ ('monitoring'), name: 'car', paused: false, cut: null, problem: null, recording: { state: 'off', for_s: null }, alarms: [], alarms_in_all: 0, ...more });
const playing = (more = {}) => state({ replay: replay(), live: live(), ...more });

test('a moment and its place on the line are each other\'s turning round, and never beyond the ends', () => {
  for (const at_s of [0, 1, 246, 512]) assert.ok(Math.abs(atOf(xOf(at_s, 512, 364), 512, 364) - at_s) < 1e-9);
  assert.equal(xOf(-5, 512, 364), 0);
  assert.equal(xOf(9e9, 512, 364), 364);
  assert.equal(xOf(5, 0, 364), 0, 'a recording of one moment');
  assert.equal(atOf(-40, 512, 364), 0);
  assert.equal(atOf(4000, 512, 364), 512);
  assert.equal(atOf(10, 512, 0), 0, 'not laid out yet');
  assert.equal(atOf(NaN, 512, 364), 0);
});

test('the speed is a line that breaks where none was recorded', () => {
  const line = { speed_mps: [0, 2, 4, null, null, null, null, 4, 2], bucket_s: 1, length_s: 9 };
  const path = speedPath(line, 90);
  assert.equal(path.match(/M/g)?.length, 2);
  assert.ok(path.startsWith(`M5.0 ${BASE.toFixed(1)}`), path);
  assert.ok(path.includes('L25.0 27.0'), 'the highest reaches the top');
  assert.equal(speedPath({ ...line, speed_mps: [1, null, 1, 1], length_s: 4 }, 90).match(/M/g)?.length, 1, 'a slow signal is one line');
  assert.equal(speedPath({ ...line, speed_mps: [null, null] }, 90), '');
  assert.equal(speedPath({ speed_mps: [], bucket_s: 1, length_s: 0 }, 90), '');
});

test('a gap is as wide as it was long, and never too narrow to be seen', () => {
  assert.deepEqual(gapBands({ gaps: [[10, 20], [50, 50.1]], length_s: 100 }, 200), [[20, 20], [100, 2]]);
});

test('marks that would cover each other are one, of the shape of the most urgent', () => {
  const marks = [mark(10, { priority: 'warning' }), mark(12), mark(13, { priority: 'warning' }), mark(60, { priority: 'warning' }), mark(80, { priority: 'advisory' })];
  const found = placed(marks, 100, 200);
  assert.deepEqual(found.map(({ x, count, priority }) => [x, count, priority]), [[20, 3, 'critical'], [120, 1, 'warning']]);
  assert.equal(found[0]?.at_s, 12);
  assert.equal(markPath(found[0] ?? assert.fail()), 'M20.0 4l8 8.5-8 8.5-8-8.5z', 'a diamond');
  assert.equal(markPath(found[1] ?? assert.fail()), 'M120.0 4.5l9 16h-18z', 'a triangle');
});

test('keys lead to the alarm before and after, and not to the one that is shown', () => {
  const marks = [mark(5), mark(10), mark(10), mark(90)];
  assert.equal(markBeside(marks, 0, 1)?.at_s, 5);
  assert.equal(markBeside(marks, 10, 1)?.at_s, 90);
  assert.equal(markBeside(marks, 10.4, -1)?.at_s, 5, 'what was just gone to is this one still');
  assert.equal(markBeside(marks, 20, -1)?.at_s, 10);
  assert.equal(markBeside(marks, 90, 1), null);
  assert.equal(markBeside([], 90, -1), null);
});

test('arrows go by steps, pages by six, ends to the ends, other keys nowhere', () => {
  assert.equal(atByKey('ArrowRight', 10, 512), 15);
  assert.equal(atByKey('ArrowLeft', 3, 512), 0);
  assert.equal(atByKey('PageUp', 10, 512), 40);
  assert.equal(atByKey('End', 10, 512), 512);
  assert.equal(atByKey('Home', 10, 512), 0);
  assert.equal(atByKey('ArrowRight', 10, 20), 11, 'a short one by a second');
  assert.equal(atByKey('x', 10, 512), null);
});

test('times as text and for a screen reader', () => {
  assert.equal(clockOf(246.9), '04:06');
  assert.equal(clockOf(3846), '1:04:06');
  assert.equal(spoken(246, 512), '4 minutes 6 seconds of 8 minutes 32 seconds');
  assert.equal(spoken(0, 3600), '0 seconds of 1 hour');
  assert.equal(spoken(61, 61), '1 minute 1 second of 1 minute 1 second');
  assert.deepEqual([0.25, 0.5, 1, 16, 8.74].map(rateWords), ['×0.25', '×0.5', '×1', '×16', '×8.74']);
});

test('the line shows first what is wrong with the replay, then what was not recorded, then the alarms', () => {
  const fast = alarm({ title: 'Speed above limit' });
  const moment = (more, rest = {}) => momentOf(playing({ replay: replay(more), ...rest }));
  assert.deepEqual(moment({}, { alarms: [fast] }), { kind: 'crit', icon: 'crit', text: 'Speed above limit', end: 're-evaluated' });
  assert.equal(moment({ alarms_from: 'recording' }, { alarms: [fast] }).end, 'original alarms');
  assert.equal(moment({}, { alarms: [fast, alarm({ id: 'b', priority: 'warning' })] }).end, '2 alarms, re-evaluated');
  assert.equal(moment({}, { alarms: [alarm({ active: false, state: 'RTN_UNACKED' })] }).text, 'No alarms', 'what was over then is no alarm of this moment');
  assert.equal(moment({ silent_s: 3.42 }, { alarms: [fast] }).text, 'Nothing recorded for 3.4 s');
  assert.equal(moment({ silent_s: null }).text, 'No message from the car yet');
  assert.equal(moment({ is_seeking: true, silent_s: 9 }).text, 'Seeking to 04:06');
  assert.equal(moment({ hangs_s: 3.2, is_seeking: true }).text, 'The replay has not answered for 3 s');
  assert.equal(moment({ is_settled: false }).text, 'Checks still warming up');
  assert.equal(momentOf(playing({ session: { paused: true } })).text, 'Monitoring was paused');
});

test('what is live is shown beside a recording: alarms, a lost link, a pause, and that it is not known', () => {
  assert.equal(asideOf(live()), null);
  assert.equal(asideOf(null)?.text, 'Live: unknown');
  assert.equal(asideOf(live({ phase: 'idle' })), null);
  assert.equal(asideOf(live({ phase: 'lost' }))?.text, 'Live: connection lost');
  assert.equal(asideOf(live({ cut: 'bridge-car' }))?.text, 'Live: the car fell silent');
  assert.equal(asideOf(live({ paused: true }))?.text, 'Live: monitoring is paused');
  const fast = alarm();
  const gps = alarm({ id: 'gps', title: 'GPS drift', priority: 'warning' });
  assert.deepEqual(asideOf(live({ alarms: [gps, fast] })), { kind: 'crit', text: 'Live: Speed above limit (2 alarms)', asking: fast });
  assert.equal(asideOf(live({ alarms: [gps] }))?.kind, 'warn');
  assert.equal(asideOf(live({ alarms: [gps] }))?.asking, null);
  assert.equal(asideOf(live({ alarms: [alarm({ state: 'ACKED' })] }))?.asking, null, 'somebody has seen it');
  assert.equal(asideOf(live({ alarms: [alarm({ state: 'SHELVED' }), alarm({ priority: 'advisory' })] })), null);
});

test('the list of jumps has alarms of every priority and gaps, in the order of time, and leads to what came before each', () => {
  const marks = [mark(20, { duration_s: 8.04 }), mark(33, { priority: 'advisory', title: 'Fuel low' }), mark(3, { priority: 'warning', duration_s: 71 })];
  const jumps = jumpsOf({ marks, gaps: [[40, 46]], flags: [], interventions: [] });
  assert.deepEqual(jumps.map(({ at_s, kind, title }) => [at_s, kind, title]), [[3, 'warning', 'Speed above limit'], [20, 'critical', 'Speed above limit'], [33, 'advisory', 'Fuel low'], [40, 'gap', 'Nothing recorded']]);
  assert.deepEqual(jumps.map(jumpAt), [0, 20 - LEAD_S, 33 - LEAD_S, 40 - LEAD_S], 'never before the beginning');
  assert.deepEqual(jumps.map((jump) => lengthOfJump(jump, true)), ['1:11 min', '8.0 s', 'to the end', '6.0 s']);
  assert.equal(lengthOfJump({ length_s: null }, false), 'end not read yet', 'what was not read is not called endless');
  assert.equal(lengthOfJump({ length_s: 12.3 }, true), '12 s');
  assert.equal(nearestJump([3, 20, 33, 40], 15), 1, 'where its own jump leads, it is the one');
  assert.equal(nearestJump([3, 20], 0), 0);
  assert.equal(nearestJump([8, 20], 0), 0, 'before the first');
  assert.equal(nearestJump([], 9), -1);
});

test('marks and interventions stand among the jumps, with their texts', () => {
  const flag = { mark: 'm', marked_ms: 0, voice: false, photo: false, source: /** @type {const} */ ('page') };
  const flags = [{ ...flag, at_s: 5, category: 'object', words: '<b>crate', by: 'A. K.' }, { ...flag, at_s: 9, category: null, words: '', by: null }];
  const interventions = [{ at_s: 7, kind_of: 'to_manual', category: 'object_late', what: 'A box.' }, { at_s: 8, kind_of: 'of a newer server', category: null, what: '' }];
  const line = { marks: [mark(6)], gaps: [], flags, interventions };
  assert.deepEqual(jumpsOf(line).map(({ at_s, kind, title, text }) => [at_s, kind, title, text]), [
    [5, 'flag', '<b>crate', 'Object · A. K.'], [6, 'critical', 'Speed above limit', ''], [7, 'wheel', 'Take-over', 'Object late: A box.'],
    [8, 'wheel', 'Intervention', 'not described'], [9, 'flag', 'Mark', ''],
  ]);
  assert.equal(jumpWords(line), '1 alarm, 2 marks, 2 interventions');
  assert.equal(lengthOfJump({ length_s: 0 }, true), '');
});

test('where a person drives is a band', () => {
  const modes = [{ mode: 'manual', from_s: 0, to_s: 10 }, { mode: 'autonomous', from_s: 10, to_s: 90 }, { mode: 'manual', from_s: 90, to_s: 90.01 }];
  assert.deepEqual(manualBands({ modes, length_s: 100 }, 200), [[0, 20], [180, 1]]);
});

test('the number of alarms is no promise while the recording is still read', () => {
  const line = { marks: [mark(1), mark(2)], marks_left_out: 3, is_done: true };
  assert.equal(countWords(line), '5 alarms');
  assert.equal(countWords({ ...line, is_done: false }), '5 alarms, still reading');
  assert.equal(countWords({ ...line, marks: [], marks_left_out: 0, is_done: false }), 'Alarms', 'not: none');
  assert.equal(countWords(null), 'Alarms');
});

test('the catalog\'s sketch is a time line that nobody has read yet', () => {
  const row = /** @type {any} */ ({ length_s: 100, speed_mps: [1, null, 3, 4], started_ms: 5000, raised: [{ at_ms: 15_000, alarm: 'a', title: 'A', priority: 'warning', text: 't' }] });
  const line = sketchOf(row) ?? assert.fail();
  assert.deepEqual([line.bucket_s, line.done_s, line.is_done], [25, 0, false]);
  assert.deepEqual(line.marks.map(({ at_s, duration_s }) => [at_s, duration_s]), [[10, null]]);
  assert.equal(sketchOf({ ...row, length_s: null }), null, 'not read yet');
  assert.equal(speedPath(sketchOf({ ...row, speed_mps: undefined }) ?? assert.fail(), 100), '');
});

test('what is live is shown in a line: the recording, and alarms that are not urgent are not called none', () => {
  const recorded = { recording: { state: 'recording', for_s: 252, reason: null } };
  assert.deepEqual(liveWords(live(recorded)), { recording: 'recording 04:12', text: 'no alarms' });
  assert.equal(liveWords(live({ alarms_in_all: 1 })).text, 'no urgent alarm, 1 other');
  assert.equal(liveWords(live()).recording, 'not recording');
  assert.equal(liveWords(live({ recording: { state: 'stopped', for_s: null, reason: 'Disk full.' } })).recording, 'recording stopped: Disk full.');
  assert.equal(liveWords(live({ phase: 'idle' })).text, 'no car is monitored');
  assert.deepEqual(liveWords(null), { text: 'alarms unknown', recording: 'recording unknown' });
  assert.equal(asideOf(summaryOf(state({ alarms: [alarm()] })))?.text, 'Live: Speed above limit', 'while it is being opened');
});

test('a recording rings nobody: no dialog, and the title has REPLAY', () => {
  const frame = playing({ alarms: [alarm()] });
  const seen = { frame, isSilent: false, silence_s: 0.1, isChoosing: false, isAnswered: false };
  assert.equal(dialogOf(seen), null);
  assert.equal(dialogOf({ ...seen, isSilent: true, silence_s: 5 })?.kind, 'lost', 'the server itself is live');
  assert.deepEqual(badgeOf(frame, { isSilent: false, isMonitoring: true, state: 'Replay' }), { title: 'REPLAY · catgraph', icon: 'replay', count: 0 });
  const alarmed = playing({ live: live({ alarms: [alarm()] }) });
  assert.deepEqual(badgeOf(alarmed, { isSilent: false, isMonitoring: true, state: 'Replay' }), { title: '(1) LIVE Speed above limit · REPLAY · catgraph', icon: 'critical', count: 1 });
  assert.equal(chainOf({ frame, isSilent: false, silence_s: 0, lag_s: 0.1, heard_ms: 0 }).state, 'Replay');
  assert.equal(chainOf({ frame, isSilent: true, silence_s: 3, lag_s: 3, heard_ms: 0 }).state, 'Lost');
});

test('what is no time line is not taken for one', () => {
  const line = { kind: 'timeline', length_s: 9, bucket_s: 1, speed_mps: [], gaps: [], marks: [], notes: [] };
  assert.equal(readMessage(JSON.stringify(line))?.kind, 'timeline');
  assert.equal(readMessage(JSON.stringify({ ...line, marks: null })), null);
  assert.equal(readMessage('{"kind":"replay"}'), null);
  assert.equal(new Track().lacks('a', 3), 0);
});

test('while a recording is shown, whether the car is recorded is stated of the car now', () => {
  const store = new Store(() => /** @type {any} */ ({}));
  store.frame = /** @type {any} */ ({ replay: {}, recording: { state: 'off', for_s: null }, alarms: [], session: {}, live: { recording: { state: 'recording', for_s: 9 }, alarms: [], phase: 'monitoring', paused: false } });
  assert.equal(store.heeded?.recording.state, 'recording');
});
