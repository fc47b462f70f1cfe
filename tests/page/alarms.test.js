import assert from 'node:assert/strict';
import { test } from 'node:test';
import { byUrgency, layOut, soundOf, stripOf, tilesOf } from '../../static/js/alarms/alarm-layout.js';
import { rowsOf } from '../../static/js/alarms/alarms-layout.js';
import { showTiles } from '../../static/js/alarms/checks.js';
import { badgeOf } from '../../static/js/shell/badge.js';
import { asideOf } from '../../static/js/replay/replay-layout.js';
import { dialogOf, linkWords, lossKey } from '../../static/js/shell/dialogs.js';
import { chainOf } from '../../static/js/core/link.js';
import { eventWords } from '../../static/js/alarms/log-layout.js';
import { alarm, state } from './frames.js';

const link = (more = {}) => alarm({ id: 'link_lost', title: 'Connection lost', actions: ['reconnect', 'change_address', 'exit'], ...more });
const warning = (more = {}) => alarm({ id: 'gps', title: 'GPS drift', priority: 'warning', place: 'snackbar', sound: 'medium', ...more });

test('one dialog: the most severe, then the newest', () => {
  const all = [alarm({ id: 'a', raised_ms: 1 }), alarm({ id: 'b', raised_ms: 2 }), alarm({ id: 'c', priority: 'warning', raised_ms: 9 }), warning()];
  assert.equal(layOut(all).dialog?.id, 'b');
  assert.deepEqual(layOut(all).snackbars.map(({ id }) => id), ['gps']);
  assert.equal(layOut([alarm({ state: 'ACKED' })]).dialog, null);
  assert.equal(layOut([alarm({ state: 'RTN_UNACKED', active: false })]).dialog?.id, 'speed_limit');
  assert.equal(layOut([warning({ state: 'SHELVED' })]).shelved, 1);
});

test('strip, list, dialog, snackbar, title and sound have one order: unacknowledged, danger, newness', () => {
  const states = /** @type {const} */ ({ UNACKED: true, RTN_UNACKED: false, ACKED: true });
  const pairs = Object.entries(states).flatMap(([name, active]) => ['critical', 'warning'].flatMap((priority) => [1, 2].map((raised_ms) => alarm({
    id: `${name} ${priority} ${raised_ms}`, title: `${name} ${priority} ${raised_ms}`, state: name, active, priority, raised_ms,
    place: priority === 'critical' ? 'dialog' : 'snackbar', sound: priority === 'critical' ? 'high' : 'medium',
  }))));
  const wanted = pairs.map(({ id }) => id).sort((a, b) => {
    const [[stateA, priorityA, newA], [stateB, priorityB, newB]] = /** @type {[string[], string[]]} */ ([a.split(' '), b.split(' ')]);
    const names = Object.keys(states);
    return names.indexOf(stateA ?? '') - names.indexOf(stateB ?? '') || (priorityA ?? '').localeCompare(priorityB ?? '') || Number(newB) - Number(newA);
  });
  const shuffled = wanted.map((_, n) => pairs[(n * 7 + 3) % pairs.length]);
  assert.deepEqual(byUrgency(shuffled).map(({ id }) => id), wanted);
  for (let from = 0; from < wanted.length; from += 1) { // as one after the other is acknowledged or goes
    const left = shuffled.filter(({ id }) => wanted.indexOf(id) >= from);
    const first = left.find(({ id }) => id === wanted[from]);
    const frame = state({ alarms: left });
    const chain = chainOf({ frame, isSilent: false, silence_s: 0.1, lag_s: 0.1, heard_ms: 0 });
    const ended = first.active ? '' : ': ended';
    assert.equal(rowsOf(left, [], true)[0]?.id, first.id);
    assert.equal(stripOf(frame, { isSilent: false, chain, paused_s: 0 }).text, `${first.title}${ended}`);
    assert.match(badgeOf(frame, { isSilent: false, isMonitoring: true, state: 'Live' }).title, new RegExp(`^\\(\\d+\\) ${first.title}${ended} `));
    assert.equal(asideOf(/** @type {any} */ ({ phase: 'monitoring', cut: null, alarms: left }))?.text.split(' (')[0], `Live: ${first.title}${ended}`);
    const asking = first.state === 'ACKED' ? null : first;
    const { dialog, snackbars } = layOut(left);
    assert.equal(dialog?.id ?? snackbars[0]?.id ?? null, asking?.id ?? null);
    assert.equal(soundOf(frame, { isServerLost: false, isLossAcknowledged: false }), asking?.active ? asking.sound : null);
  }
});

test('a dialog for an ended alarm comes only once nothing active is unacknowledged', () => {
  const ended = alarm({ state: 'RTN_UNACKED', active: false });
  assert.equal(layOut([ended, warning()]).dialog, null, 'its dialog would cover the warning');
  assert.equal(layOut([ended, warning({ state: 'ACKED' })]).dialog?.id, ended.id);
  assert.equal(layOut([ended, alarm({ id: 'disk', priority: 'advisory', place: 'list', sound: 'none' })]).dialog?.id, ended.id, 'what the list alone shows holds nothing back');
  assert.equal(layOut([warning(), alarm({ raised_ms: -1 })]).dialog?.id, 'speed_limit', 'what is active is, whatever is newer');
});

test('the loudest unacknowledged alarm sounds', () => {
  const page = { isServerLost: false, isLossAcknowledged: false };
  assert.equal(soundOf(state({ alarms: [warning(), alarm()] }), page), 'high');
  assert.equal(soundOf(state({ alarms: [warning(), alarm({ state: 'ACKED' })] }), page), 'medium');
  assert.equal(soundOf(state({ alarms: [alarm({ state: 'RTN_UNACKED' })] }), page), null);
  assert.equal(soundOf(state({ session: { paused: true } }), page), null);
  assert.equal(soundOf(state({ alarms: [warning()], session: { paused: true } }), page), 'medium', 'what the server tells although paused');
  assert.equal(soundOf(state({ alarms: [alarm({ sound: 'none' })] }), page), null);
  assert.equal(soundOf(state({ alarms: [alarm({ silenced_until_ms: 1 }), warning()] }), page), 'medium', 'silenced alone');
});

test('a server that fell silent is the loudest of all, until it is acknowledged', () => {
  assert.equal(soundOf(state(), { isServerLost: true, isLossAcknowledged: false }), 'high');
  assert.equal(soundOf(state(), { isServerLost: true, isLossAcknowledged: true }), null);
  assert.equal(soundOf(state({ session: { paused: true } }), { isServerLost: true, isLossAcknowledged: false }), null);
});

const seen = { isSilent: false, silence_s: 0.1, isChoosing: false, isAnswered: false };

test('which dialog stands', () => {
  const kind = (/** @type {any} */ frame, more = {}) => dialogOf({ frame, ...seen, ...more })?.kind ?? null;
  assert.equal(kind(state({ alarms: [alarm()] })), 'alarm');
  assert.equal(kind(state({ alarms: [alarm()], session: { paused: true } })), null);
  assert.equal(kind(state({ session: { phase: 'lost' }, alarms: [link()] })), 'lost');
  assert.equal(kind(state({ session: { phase: 'lost' } })), 'lost');
  assert.equal(kind(state({ session: { phase: 'lost' } }), { isAnswered: true }), null);
  assert.equal(kind(state({ session: { phase: 'lost' } }), { isChoosing: true }), null);
  assert.equal(kind(state({ link: { cut: 'bridge-car', topics_heard: 0, car_age_s: null } })), 'mute');
  assert.equal(kind(state({ link: { cut: 'bridge-car', topics_heard: 4 } })), null); // the veil shows it
  assert.equal(kind(state({ session: { phase: 'failed' } })), 'failed');
  assert.equal(kind(state({ session: { phase: 'failed' } }), { isChoosing: true }), null);
  assert.equal(kind(state({ session: { phase: 'idle' } })), null);
  assert.equal(kind(null), null);
});

test('an alarm of the car stands above one of the link, and reaches an operator who is choosing', () => {
  const both = state({ alarms: [alarm({ raised_ms: 1 }), link({ priority: 'warning' })] });
  assert.equal(dialogOf({ frame: both, ...seen })?.alarm?.id, 'speed_limit');
  assert.equal(dialogOf({ frame: both, ...seen, isChoosing: true })?.alarm?.id, 'speed_limit');
});

test('a silent server shows no old alarm as live; its own dialog comes after the veil', () => {
  const frame = state({ alarms: [alarm()] });
  assert.equal(dialogOf({ frame, ...seen, isSilent: true, silence_s: 3 }), null);
  assert.deepEqual(dialogOf({ frame, ...seen, isSilent: true, silence_s: 4.1 }), { kind: 'lost', alarm: null });
  assert.equal(dialogOf({ frame: state({ session: { phase: 'idle' } }), ...seen, isSilent: true, silence_s: 9 }), null);
});

test('a dialog that was answered stays closed until something else is lost', () => {
  const lost = state({ session: { phase: 'lost' }, link: { since_ms: 20_000 } });
  assert.equal(lossKey(lost, false), lossKey(lost, false));
  assert.notEqual(lossKey(lost, false), lossKey(lost, true));
  assert.notEqual(lossKey(lost, false), lossKey(state({ session: { phase: 'lost' }, link: { since_ms: 90_000 } }), false));
  assert.equal(lossKey(state(), false), 'none');
});

test('the text of a lost link warns of a moving car', () => {
  const frame = state({ session: { phase: 'lost' }, link: { cut: 'server-bridge', attempts: 3, trying_for_s: 6 } });
  const [bold, plain, more] = linkWords('lost', chainOf({ frame, isSilent: false, silence_s: 0, lag_s: 0, heard_ms: 0 }), frame);
  assert.equal(bold, 'The bridge stopped answering.');
  assert.match(plain, /dials again; 3 tries so far\.$/);
  assert.match(more, /may still be moving/);
});

/** @param {any} frame */
const strip = (frame, more = {}) => stripOf(frame, { isSilent: false, paused_s: 42.7, chain: chainOf({ frame, isSilent: false, silence_s: 0, lag_s: 0, heard_ms: 0 }), ...more });

test('the strip shows the worst standing alarm', () => {
  const checks = /** @type {any} */ ([{ id: 'a', label: 'A', verdict: 'ok' }, { id: 'b', label: 'B', verdict: 'unknown' }]);
  assert.deepEqual([strip(state({ checks })).text, strip(state({ checks })).end], ['No alarms', '1 OK · 1 not checked']);
  const fault = /** @type {any} */ ({ id: 'c', label: 'C', verdict: 'fault' });
  const quiet = strip(state({ checks: [...checks, fault] }));
  assert.deepEqual([quiet.icon, quiet.end], ['info', '1 FAULT · 1 not checked'], 'its alarm is suppressed');
  assert.deepEqual(strip(state({ alarms: [alarm()] })), { kind: 'crit', icon: 'crit', text: 'Speed above limit', end: '2.3 s', hasReturned: false, isKnown: false, opens: 'alarms' });
  assert.equal(strip(state({ alarms: [alarm({ state: 'ACKED' })] })).isKnown, true, 'outlined');
  assert.equal(strip(state({ alarms: [alarm()], suppressed: [{}] })).end, '1 of 2', 'of all in the list');
  assert.deepEqual([strip(state({ alarms: [warning(), warning({ id: 'b' })] })).kind, strip(state({ alarms: [warning(), warning({ id: 'b' })] })).end], ['warn', '1 of 2']);
  assert.equal(strip(state({ session: { paused: true } })).text, 'Paused 0:42: no alarm is raised');
  assert.equal(strip(state({ session: { phase: 'lost' } })).kind, 'crit');
  assert.equal(strip(state({ link: { cut: 'bridge-car' } })).text, 'Values are not live');
  assert.equal(strip(null).text, 'Nothing received yet');
  assert.equal(strip(state({ alarms: [alarm({ state: 'SHELVED', priority: 'warning' })] })).text, 'No alarms');
});

test('no tick stands in the strip while a value is stale, and checks at fault are counted whatever else stands there', () => {
  const ok = /** @type {any} */ ({ id: 'a', label: 'A', verdict: 'ok' });
  const [fault, unknown] = ['fault', 'unknown'].map((verdict) => ({ ...ok, id: verdict, label: verdict, verdict }));
  const read = (/** @type {any} */ frame, more = {}) => [strip(frame, more).icon, strip(frame, more).text, strip(frame, more).end];
  assert.deepEqual(read(state({ checks: [ok, unknown] }), { stale: 0 }), ['ok', 'No alarms', '1 OK · 1 not checked']);
  assert.deepEqual(read(state({ checks: [ok, unknown] }), { stale: 9 }), ['info', 'No alarms', '9 stale · 1 not checked']);
  const decelerate = { state: 'armed' };
  assert.deepEqual(read(state({ checks: [ok, unknown], decelerate })), ['ok', 'No alarms', '1 OK · 1 not checked']);
  assert.deepEqual(read(state({ checks: [ok, fault], decelerate })), ['info', 'No alarms', '1 FAULT · 0 not checked']);
  assert.deepEqual(read(state({ checks: [ok], decelerate }), { stale: 9 }), ['info', 'No alarms', '9 stale · 0 not checked']);
  assert.deepEqual(read(state({ checks: [ok, unknown] }), { stale: 9, unchecked: 'ok' }), ['info', 'No alarms', '9 stale · 2 not checked'], 'as the tiles');
  assert.deepEqual(read(state({ checks: [ok, unknown, fault] }), { stale: 9, unchecked: 'ok' }), ['info', 'No alarms', '1 FAULT · 2 not checked'], 'a fault stays');
  assert.deepEqual(read(state({ checks: [ok, unknown, fault] }), { stale: 0, unchecked: 'all' }), ['info', 'No alarms', '0 OK · 3 not checked'], 'no tick where nothing is checked');
  const alarms = [alarm({ state: 'SHELVED', priority: 'warning' })];
  assert.deepEqual(read(state({ checks: [ok, fault, unknown], alarms })), ['info', 'No alarms', '1 shelved · 1 FAULT']);
  assert.deepEqual(read(state({ checks: [ok, unknown], alarms })), ['ok', 'No alarms', '1 shelved · 1 not checked']);
  const advisory = [warning({ priority: 'advisory', title: 'Component warns' })];
  assert.deepEqual(read(state({ checks: [ok, fault, unknown], alarms: advisory })), ['info', 'Component warns', '1 FAULT']);
});

test('what still stands comes before what has returned, and the strip shows which it is', () => {
  const returned = alarm({ state: 'RTN_UNACKED', active: false });
  const both = strip(state({ alarms: [returned, warning({ active: true })] }));
  assert.deepEqual([both.kind, both.text, both.hasReturned, both.end], ['warn', warning().title, false, '1 of 2']);
  const only = strip(state({ alarms: [returned] }));
  assert.deepEqual([only.kind, only.text, only.hasReturned, only.end], ['crit', 'Speed above limit: ended', true, '1 alarm']);
});

test('an advisory hides neither a warning that waits to be acknowledged nor how many alarms there are', () => {
  const advisory = warning({ id: 'moving', priority: 'advisory', title: 'Component warns' });
  const returned = strip(state({ alarms: [advisory, warning({ state: 'RTN_UNACKED', active: false })] }));
  assert.deepEqual([returned.kind, returned.text, returned.hasReturned, returned.end], ['warn', `${warning().title}: ended`, true, '1 of 2']);
  assert.equal(strip(state({ alarms: [advisory, { ...advisory, id: 'b' }] })).end, '1 of 2');
  const checks = /** @type {any} */ ([{ id: 'a', label: 'A', verdict: 'ok' }, { id: 'b', label: 'B', verdict: 'unknown' }]);
  assert.equal(strip(state({ checks, alarms: [advisory] })).end, '1 not checked');
  assert.equal(strip(state({ checks: checks.slice(0, 1), alarms: [advisory] })).end, '1 OK');
});

test('one tile for the checks that share it; the worst speaks', () => {
  const check = (/** @type {string} */ id, /** @type {string} */ verdict, label = 'Signals') => /** @type {any} */ ({ id, label, verdict, brief: id, text: '' });
  assert.deepEqual(tilesOf([check('a', 'ok'), check('b', 'fault'), check('c', 'unknown'), check('d', 'ok', 'Speed')]).map(({ label, verdict, brief }) => [label, verdict, brief]),
    [['Signals', 'fault', 'b'], ['Speed', 'ok', 'd']]);
});

test('tiles: paused means not checked, but for faults the server finds all the same; fuel is never 0', () => {
  const checks = /** @type {any} */ ([{ id: 'speed', label: 'Speed', verdict: 'ok', brief: 'OK', checks: ['speed_limit'] }]);
  const rows = (/** @type {string | null} */ why, frame = state({ checks })) => showTiles(frame, why, false).map(({ label, kind, lines }) => [label, kind, ...lines]);
  assert.deepEqual(rows(null), [['Speed', 'ok', 'OK'], ['Fuel', 'unk', 'not published']]);
  assert.deepEqual(rows('paused')[0], ['Speed', 'unk', 'not checked', 'paused']);
  const fault = state({ checks: [{ ...checks[0], verdict: 'fault', brief: 'FAULT 12.6 m/s' }], alarms: [alarm()] });
  assert.deepEqual(rows(null, fault)[0], ['Speed', 'crit', 'FAULT 12.6 m/s']);
  const forgotten = state({ checks: [{ ...checks[0], label: 'Monitoring', verdict: 'fault', brief: 'FAULT 5 min' }] });
  assert.deepEqual(rows('paused', forgotten)[0], ['Monitoring', 'warn', 'FAULT 5 min']);
  assert.deepEqual(rows('stale', fault)[0], ['Speed', 'unk', 'not checked', 'stale']);
  const aged = (frame = state({ checks })) => showTiles(frame, null, false, true).map(({ kind, lines }) => [kind, ...lines])[0];
  assert.deepEqual(aged(), ['unk', 'not checked', 'stale']);
  assert.deepEqual(aged(fault), ['crit', 'FAULT 12.6 m/s'], 'it stands until it is checked again');
});

test('the log tells what happened', () => {
  const event = /** @type {any} */ ({ n: 1, at_ms: 0, alarm: 'speed_limit', change: 'cleared', title: 'Speed above limit', priority: 'critical', text: 'back under', by: null });
  assert.deepEqual(eventWords(event), { icon: 'ok', kind: '', title: 'Speed above limit: ended', text: 'back under' });
  assert.equal(eventWords({ ...event, change: 'raised' }).icon, 'crit');
  assert.equal(eventWords({ ...event, alarm: null, change: 'lost', text: 'The bridge closed the connection.' }).title, 'The bridge closed the connection.');
  assert.equal(eventWords({ ...event, change: 'something_new' }).title, 'Speed above limit something_new');
});
