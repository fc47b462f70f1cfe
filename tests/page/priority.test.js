import assert from 'node:assert/strict';
import { test } from 'node:test';
import { layOut, soundOf, stripOf } from '../../static/js/alarms/alarm-layout.js';
import { rowsOf } from '../../static/js/alarms/alarms-layout.js';
import { eventWords, fits } from '../../static/js/alarms/log-layout.js';
import { countsOf } from '../../static/js/files/files-layout.js';
import { placedMarks } from '../../static/js/home/drive-layout.js';
import { chainOf } from '../../static/js/core/link.js';
import { priorityOf } from '../../static/js/core/priority.js';
import { readMessage } from '../../static/js/core/protocol.js';
import { dialogOf } from '../../static/js/shell/dialogs.js';
import { rowsOf as carRows } from '../../static/js/shell/cars-layout.js';
import { alarm, state } from './frames.js';

/** As another version of the server sends it. */
const FOREIGN = { id: 'wheel_lost', title: 'Wheel lost', priority: 'extreme', place: 'ceiling', sound: 'siren', state: 'ESCALATED' };
const WORST = { priority: 'critical', place: 'dialog', sound: 'high', state: 'UNACKED' };
const read = (/** @type {object} */ message) => /** @type {any} */ (readMessage(JSON.stringify(message)));
const picked = (/** @type {any} */ { priority, place, sound, state: found }) => ({ priority, place, sound, state: found });

test('a priority that is not known is the most urgent, one that is known stays', () => {
  assert.deepEqual(['critical', 'warning', 'advisory', 'extreme', '', 'toString', undefined, null, 3].map(priorityOf),
    ['critical', 'warning', 'advisory', ...Array(6).fill('critical')]);
});

test('an alarm of another version has a dialog, sounds and is named, whatever it calls its place', () => {
  const frame = read(state({ alarms: [alarm(FOREIGN), alarm({ id: 'gps', title: 'GPS drift', priority: 'warning', place: 'snackbar', sound: 'medium' })] }));
  assert.deepEqual(picked(frame.alarms[0]), WORST);
  const seen = { isSilent: false, silence_s: 0, lag_s: 0, heard_ms: 0, unserved: '' };
  assert.equal(stripOf(frame, { ...seen, chain: chainOf({ frame, ...seen }), paused_s: 0 }).text, 'Wheel lost');
  assert.equal(layOut(frame.alarms).dialog?.id, 'wheel_lost');
  assert.equal(dialogOf({ frame, ...seen, isChoosing: false, isAnswered: false })?.alarm?.id, 'wheel_lost');
  assert.equal(soundOf(frame, { isServerLost: false, isLossAcknowledged: false }), 'high');
  assert.equal(rowsOf(frame.alarms, [], 0)[0]?.title, 'Wheel lost');
});

test('what is known of an alarm stays as it is: an advisory is no dialog', () => {
  const known = alarm({ id: 'x', priority: 'advisory', place: 'list', sound: 'low', state: 'ACKED' });
  assert.deepEqual(read(state({ alarms: [known] })).alarms, [known]);
});

test('an alarm without a title is called by its id', () => {
  const { title: _, ...nameless } = alarm(FOREIGN);
  assert.equal(read(state({ alarms: [nameless] })).alarms[0].title, 'wheel_lost');
});

test('the live car beside a replay, and a recording beside another one', () => {
  assert.deepEqual(picked(read(state({ live: { alarms: [alarm(FOREIGN)] } })).live.alarms[0]), WORST);
  assert.deepEqual(picked(read({ kind: 'beside', replay: {}, state: state({ alarms: [alarm(FOREIGN)] }), notes: [] }).state.alarms[0]), WORST);
});

test('the card of a car shows the alarm with its text, as the most urgent', () => {
  const { place: _, actions: __, ...worst } = alarm(FOREIGN);
  const summary = {
    phase: 'monitoring', paused: false, link: { cut: null, bridge_age_s: 0, car_age_s: 0, trying_for_s: 0, connected_for_s: 9 }, worst, waiting: 1,
    speed: { value_mps: 1, freshness: 'fresh', age_s: 0, horizon_s: 1 }, holder: null, recording: 'off', slow_down: 'not_armed',
  };
  const [row] = carRows(read({ kind: 'cars', time_ms: 0, cars: [{ name: 'Serval', age_s: 0, summary, trouble: null }] }), 0, '');
  assert.deepEqual({ needs: row?.needs, icon: row?.icon, kind: row?.kind, isNamed: row?.text.startsWith('Wheel lost') }, { needs: true, icon: 'crit', kind: 'crit', isNamed: true });
});

test('the log: the mark of a critical alarm, found by that filter; what is of no alarm has none', () => {
  const { events: [raised, escalated, paused] } = read({ kind: 'events', events: [
    { n: 1, at_ms: 0, alarm: 'wheel_lost', title: 'Wheel lost', change: 'raised', priority: 'extreme', text: 'rear left', by: null },
    { n: 2, at_ms: 0, alarm: 'wheel_lost', title: 'Wheel lost', change: 'escalated', text: '', by: null },
    { n: 3, at_ms: 0, alarm: null, change: 'paused', text: 'Paused', by: null },
  ] });
  assert.deepEqual(eventWords(raised), { icon: 'crit', kind: 'c-crit', title: 'Wheel lost', text: 'rear left' });
  assert.deepEqual(eventWords(escalated), { icon: 'crit', kind: 'c-crit', title: 'Wheel lost escalated', text: '' }); // no tick
  assert.equal(fits(raised, { kind: 'critical', text: '' }), true);
  assert.equal(fits(paused, { kind: 'critical', text: '' }), false);
});

test('the time line of a replay draws it, and Files counts it', () => {
  const { marks } = read({ kind: 'timeline', length_s: 9, bucket_s: 1, speed_mps: [], gaps: [], notes: [], marks: [{ at_s: 2, alarm: 'wheel_lost', title: 'Wheel lost', priority: 'extreme', text: '', duration_s: null }] });
  assert.equal(placedMarks(marks, [0, 9], 90)[0]?.priority, 'critical');
  assert.deepEqual(countsOf({ critical: 1, extreme: 2, advisory: 1 }).map(({ text }) => text), ['3 critical alarms', '1 advisory']);
});
