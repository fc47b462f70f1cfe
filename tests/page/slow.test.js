import assert from 'node:assert/strict';
import { test } from 'node:test';
import { soundOf, stripOf } from '../../static/js/alarms/alarm-layout.js';
import { orderMark } from '../../static/js/home/gauge-layout.js';
import { chainOf } from '../../static/js/core/link.js';
import { eventWords } from '../../static/js/alarms/log-layout.js';
import { NOT_CONFIRMED, connectRow, countdownOf, guardWords, holdOf, orderWords, releaseOf, sheetOf, slideOf, stateWord, stepsOf, stripWords } from '../../static/js/slowdown/slow-layout.js';
import { alarm, state } from './frames.js';

/** @typedef {import('../../static/js/slowdown/slow-layout.js').Seen} Seen */

/** @returns {any} */
const slow = (/** @type {string} */ name, more = {}) => ({
  state: name, why: null, topic: '/catvehicle/cmd_vel', type: 'geometry_msgs/Twist', rivals: [], armed_by: 'Ann', deceleration_mps2: 1.5, order: null, countdown: null, guard: null, ...more,
});
const STEPS = { pressed_ms: 1000, server_ms: 1020, bridge_ms: 1031, slows_ms: 1420 };
/** @returns {any} */
const order = (more = {}) => ({
  number: 3, by: 'Ann', why: 'by hand', for_s: 2.1, from_mps: 4.2, ordered_mps: 2.2, deceleration_mps2: 1.5, sending: true, confirmed: true, steps: STEPS, longest_s: 600, ...more,
});
const ordered = (more = {}, name = 'ordered') => slow(name, { order: order(more) });
/** @returns {Seen} */
const seen = (/** @type {any} */ now, more = {}) => ({ now, isSilent: false, isViewer: false, isReplay: false, mayControl: true, holder: null, ...more });

test('the slide: off with the reason, armed, or filled; silent or looked at only, it is off', () => {
  const label = (/** @type {any} */ now, more = {}) => {
    const { kind, title, why } = slideOf(seen(now, more));
    return `${kind}: ${title} ${why}`;
  };
  assert.equal(label(slow('not_available', { why: 'No link to the car.' })), 'off: Not available No link to the car');
  assert.equal(label(slow('not_available', { why: 'The steering of this kind of car is not known, and a command would turn its wheels.' })), 'off: Not available press for the reason');
  assert.equal(label(slow('not_armed')), 'off: Slow-down not armed press to arm');
  assert.equal(label(slow('not_armed'), { isViewer: true }), 'off: Slow-down not armed not for viewers');
  assert.equal(label(slow('armed'), { car: 'Ocelot', vehicle: 'Ocelot' }), 'armed: Slide to slow Ocelot');
  assert.equal(label(slow('armed')), 'armed: Slide to slow the car');
  assert.equal(label(slow('armed'), { isViewer: true }), 'off: Slow-down armed not for viewers');
  assert.equal(label(slow('armed'), { mayControl: false, holder: 'Ben' }), 'armed: Slide to slow the car', 'any operator stops the car');
  assert.equal(label(slow('armed'), { isSilent: true }), 'off: State unknown no answer');
  const inAlarm = (/** @type {any} */ now, more = {}) => slideOf(seen(now, more), true);
  assert.equal(inAlarm(slow('not_armed')).label, 'Acknowledge first: then arm it', 'nothing is armed from the sheet of an alarm');
  assert.equal(inAlarm(slow('not_armed'), { isViewer: true }).why, 'not for viewers');
  assert.deepEqual(inAlarm(slow('armed')), slideOf(seen(slow('armed'))), 'but a slide slows from it');
  assert.equal(label(null), 'off: State unknown no answer');
  assert.equal(label(ordered()), 'go: Slowing to 0.0 m/s');
  assert.equal(label(ordered({ confirmed: null })), 'go: Ordered to 0.0 m/s', 'not confirmed yet is not "slowing"');
  assert.equal(label(ordered({ confirmed: false })), 'go: Use the physical stop');
  assert.equal(label(ordered({ sending: false })), 'go: Not sending to the car now');
  assert.equal(label(ordered({}, 'holding')), 'go: Holding at 0.0 m/s');
  assert.equal(label(slow('something new', { why: null })), 'off: Not available not available');
});

test('one term of its state, never a comfortable one', () => {
  const state = (/** @type {any} */ now, more = {}) => stateWord(seen(now, more));
  assert.deepEqual(['not_available', 'not_armed', 'armed', 'else'].map((name) => state(slow(name))), ['NOT AVAILABLE', 'NOT ARMED', 'ARMED', 'NOT AVAILABLE']);
  assert.equal(state(slow('armed'), { isSilent: true }), 'NOT KNOWN');
  assert.deepEqual([true, null, false].map((confirmed) => state(ordered({ confirmed }))), ['SLOWING', 'ORDERED', 'NOT CONFIRMED']);
  assert.equal(state(ordered({ sending: false })), 'NOT SENDING');
  assert.equal(state(ordered({}, 'holding')), 'HOLDING');
  assert.equal(state(ordered({ confirmed: null }, 'holding')), 'ORDERED', 'zeros are sent: that is not yet a car that is held');
  assert.deepEqual(['before', 'unproven'].map((stands) => state(ordered({ confirmed: null, stands }, 'holding'))), ['STANDING', 'STANDING']);
});

test('the strip: what is checked while armed, the order above warnings, a critical alarm above the order', () => {
  const strip = (/** @type {any} */ more) => {
    const frame = state(more);
    return stripOf(frame, { isSilent: false, paused_s: 0, chain: chainOf({ frame, isSilent: false, silence_s: 0.1, lag_s: 0.1, heard_ms: 0 }) });
  };
  const warning = alarm({ id: 'gps', title: 'GPS drift', priority: 'warning', place: 'snackbar' });
  assert.deepEqual(strip({ decelerate: slow('armed') }), { kind: '', icon: 'ok', text: 'No alarms', end: '0 OK · 0 not checked', opens: 'alarms' });
  assert.equal(strip({ decelerate: slow('armed'), alarms: [warning] }).text, 'GPS drift');
  assert.equal(strip({ decelerate: slow('not_armed') }).text, 'No alarms');
  assert.deepEqual(strip({ decelerate: ordered() }), { kind: 'order', icon: 'slow', text: 'Slowing the car', end: '−1.5 m/s² ordered', opens: 'alarms' });
  const checks = ['ok', 'ok', 'unknown'].map((verdict, n) => ({ id: `${n}`, label: `${n}`, verdict }));
  const ends = (/** @type {any} */ decelerate) => [checks, [...checks, { id: 'f', label: 'F', verdict: 'fault' }]].map((all) => strip({ decelerate, checks: /** @type {any} */ (all) }).end);
  assert.deepEqual(ends(ordered()), ['−1.5 m/s² ordered', '−1.5 m/s² · 1 FAULT']);
  assert.deepEqual(ends(ordered({}, 'holding')), ['0.0 m/s ordered', 'ordered · 1 FAULT']);
  assert.deepEqual(ends(ordered({ confirmed: null })), ['−1.5 m/s²', '−1.5 m/s² · 1 FAULT']);
  assert.deepEqual(ends(ordered({ sending: false })), ['', '1 FAULT']);
  assert.deepEqual(ends(ordered({ confirmed: null, stands: 'before' }, 'holding')), ['stood already', '1 FAULT']);
  assert.equal(strip({ decelerate: ordered(), alarms: [warning] }).end, '−1.5 m/s² · 1 alarm');
  assert.equal(strip({ decelerate: ordered(), alarms: [alarm({ state: 'ACKED' })] }).text, 'Speed above limit');
  assert.equal(strip({ decelerate: ordered(), session: { paused: true } }).kind, 'invert');
  assert.deepEqual([strip({ decelerate: ordered({ confirmed: false }) }).text, strip({ decelerate: ordered({ confirmed: false }) }).kind], [NOT_CONFIRMED, 'crit']);
  const says = (/** @type {any} */ one) => [true, false].map((active) => strip({ decelerate: ordered({ confirmed: false }), alarms: [alarm({ active, ...one })] }).isUnconfirmed);
  assert.deepEqual(says({ id: 'slow_down_unconfirmed', title: 'The car does not slow' }), [true, undefined], 'by the id of the alarm');
  assert.equal(says({ id: 'speed_limit', title: 'NOT CONFIRMED' })[0], undefined, 'not by its text');
  assert.equal(strip({ decelerate: ordered({ confirmed: false }), alarms: [warning] }).isUnconfirmed, true);
  assert.equal(stripWords(ordered({ confirmed: null }), 0)?.text, 'Slow-down ordered');
  assert.equal(stripWords(ordered({}, 'holding'), 0)?.end, '0.0 m/s ordered');
  assert.deepEqual([stripWords(ordered({ confirmed: null }, 'holding'), 0)?.text, stripWords(ordered({ confirmed: null, stands: 'before' }, 'holding'), 0)?.text], ['Slow-down ordered', 'The car stands']);
  assert.equal(stripWords(ordered({ sending: false }), 2)?.text, 'Not sending to the car');
  assert.equal(stripWords(undefined, 0), null);
});

test('four steps, each with how much later it was; what is not there is not a number', () => {
  const steps = (more = {}) => stepsOf(order(more)).map(({ label, value, mark }) => `${label} ${value} ${mark}`);
  assert.deepEqual(steps().slice(1), ['At the server +0.02 s ok', 'On the bridge +0.03 s ok', 'Car slows +0.42 s ok']);
  assert.match(steps()[0] ?? '', /^Pressed \d\d:\d\d:\d\d ok$/);
  assert.deepEqual(steps({ confirmed: null, steps: { ...STEPS, bridge_ms: null, slows_ms: null } }).slice(2), ['On the bridge – wait', 'Car slows – wait']);
  assert.equal(steps({ confirmed: false })[3], 'Car slows NOT SEEN crit', 'also where it had slowed before');
  assert.equal(steps({ sending: false, steps: { ...STEPS, bridge_ms: null, slows_ms: null }, confirmed: null })[2], 'On the bridge no link crit');
  assert.equal(steps({ confirmed: null, stands: 'before' })[3], 'Car stands already wait', 'nothing was shown to slow');
  assert.equal(steps({ confirmed: null, stands: 'unproven' })[3], 'Car stands not proven wait');
  assert.match(steps({ why: 'Speed above limit', steps: { ...STEPS, pressed_ms: null } })[0] ?? '', /^By itself /);
  assert.equal(steps({ why: 'Speed above limit', steps: { ...STEPS, pressed_ms: null } })[2], 'On the bridge +0.01 s ok');
  assert.equal(steps({ steps: { pressed_ms: null, server_ms: null, bridge_ms: null, slows_ms: null }, confirmed: null })[0], 'Pressed – wait');
});

test('the line beneath the steps: who, why and since when; or what is wrong', () => {
  assert.deepEqual(orderWords(order(), 0.1), { text: 'By Ann from 4.2 m/s, 2.2 s ago', kind: '' });
  assert.equal(orderWords(order({ why: 'Speed above limit', from_mps: null }), 0).text, 'By itself: Speed above limit, 2.1 s ago');
  assert.deepEqual(orderWords(order({ confirmed: false, sending: false }), 0), { text: NOT_CONFIRMED, kind: 'crit' });
  assert.equal(orderWords(order({ sending: false }), 0).kind, 'crit');
  assert.match(orderWords(order({ confirmed: null, stands: 'before' }), 0).text, /already standing: nothing to slow/);
});

test('the count-down ends at 0 and is none once the order stands; its sound is of its own', () => {
  const countdown = { trigger: 'speed', title: 'Speed above limit', text: '12.4 m/s', left_s: 1.4 };
  assert.equal(countdownOf(slow('armed', { countdown }), 0.4)?.left_s.toFixed(3), '1.000');
  assert.equal(countdownOf(slow('armed', { countdown }), 9)?.left_s, 0);
  assert.equal(countdownOf({ ...ordered(), countdown }, 0), null);
  assert.equal(countdownOf(null, 0), null);
  const page = { isServerLost: false, isLossAcknowledged: false };
  assert.equal(soundOf(state({ decelerate: slow('armed', { countdown }), alarms: [alarm()] }), page), 'count');
  assert.equal(soundOf(state({ decelerate: slow('armed') }), page), null);
});

test('the guard: only one that sends and guards is shown as guarding', () => {
  const guardOf = (/** @type {any} */ guard, lag_s = 0) => guardWords(guard && { why: '', hold: 0, age_s: 0.2, ...guard }, lag_s);
  assert.match(guardOf(null).text, /link loss will NOT slow the car$/);
  for (const [name, isGuarded] of /** @type {const} */ ([['guarded', true], ['operator', true], ['slowing', true], ['holding', true], ['unguarded', false], ['new', false]])) {
    const { text, isGuarded: found } = guardOf({ state: name });
    assert.equal(found, isGuarded, name);
    assert.match(text, isGuarded ? /^GUARDED/ : /^UNGUARDED.*will NOT slow the car$/);
  }
  assert.match(guardOf({ state: 'guarded', age_s: 3.2 }).text, /^No message from the guard for 3\.2 s: link loss may NOT slow the car$/);
  assert.equal(guardOf({ state: 'guarded' }, 2).isGuarded, false, 'the page’s own silence counts');
  assert.equal(guardOf({ state: 'guarded', age_s: null }).isGuarded, false);
});

test('a release ends the order, or what the guard holds by itself, by its number', () => {
  const guard = (/** @type {string} */ name) => ({ state: name, why: 'heartbeat stopped', hold: 7, age_s: 0.1 });
  assert.deepEqual(holdOf(ordered()), { number: 3, isGuards: false });
  assert.deepEqual(holdOf(slow('not_armed', { guard: guard('holding') })), { number: 7, isGuards: true });
  assert.equal(holdOf(slow('armed', { guard: guard('guarded') })), null);
  assert.equal(holdOf(null), null);
  assert.equal(stripWords(slow('not_armed', { guard: guard('slowing') }), 0)?.text, 'The guard slows the car');
  assert.equal(stripWords(slow('armed', { guard: guard('holding') }), 0)?.text, 'The guard holds the car');
});

test('who may release, and who instead', () => {
  assert.equal(releaseOf(seen(ordered())).can, true);
  assert.deepEqual(releaseOf(seen(ordered(), { mayControl: false, holder: 'Ben' })).label, 'Only Ben can release');
  assert.equal(releaseOf(seen(ordered(), { isViewer: true })).can, false);
});

test('the sheet: what would be commanded, who competes, and the one thing this page may do', () => {
  const sheet = (/** @type {any} */ now, more = {}) => sheetOf(seen(now, more), 0);
  const notArmed = sheet(slow('not_armed', { rivals: ['/lap_driver', '/joy'] }));
  assert.deepEqual([notArmed.title, notArmed.act], ['Arm the slow-down?', 'arm']);
  assert.deepEqual(notArmed.facts[1], ['Commanded on', '/catvehicle/cmd_vel', false]);
  assert.deepEqual(notArmed.facts[3], ['Slows at', '1.5 m/s²', false]);
  assert.deepEqual(notArmed.facts[0], ['Other publishers', '/lap_driver, /joy: the last message wins, so the car may not slow', true]);
  assert.match(notArmed.aid, /^An aid, not an emergency stop/);
  assert.equal(notArmed.isGuarded, false);
  assert.equal(sheet(slow('not_armed', { rivals: null })).facts[0]?.[2], true, 'not known is no "none"');
  assert.equal(sheet(slow('not_armed')).facts[0]?.[1], 'none');
  const other = sheet(slow('not_armed'), { mayControl: false, holder: 'Ben' });
  assert.deepEqual([other.act, other.message], ['ask', 'Ben is in control and can arm it.']);
  assert.equal(sheet(slow('armed')).act, 'disarm');
  assert.match(sheet(slow('armed')).text, /^Armed by Ann\./);
  assert.deepEqual([sheet(slow('armed'), { isViewer: true }).act, sheet(slow('not_armed'), { isReplay: true }).act, sheet(slow('not_armed'), { isSilent: true }).act, sheet(ordered()).act], [null, null, null, null]);
  const none = sheet(slow('not_available', { why: 'No link to the car.', topic: null }));
  assert.deepEqual([none.title, none.text, none.facts, none.act], ['Slow-down not available', 'No link to the car.', [], null]);
});

test('its row on the connect screen', () => {
  assert.equal(connectRow(slow('armed'), false).tag, 'Not armed');
  assert.deepEqual([connectRow(slow('armed'), true).tag, connectRow(slow('not_armed'), true).tag, connectRow(ordered(), true).tag], ['Armed', 'Not armed', 'Slowing']);
  assert.deepEqual(connectRow(slow('not_available', { why: 'No link to the car.' }), true), { tag: 'Not available', kind: 'unk', cost: 'No link to the car' });
});

test('in the log: each step by its mark, one that was not confirmed as what it is', () => {
  const row = (/** @type {any} */ more) => eventWords({ n: 1, at_ms: 0, alarm: null, by: 'Ann', text: 'Slow-down ordered.', change: 'slow_down', ...more });
  assert.deepEqual(row({ step: 'ordered' }), { icon: 'slow', kind: 'c-order', title: 'Slow-down ordered.', text: 'by Ann' });
  assert.deepEqual([row({ step: 'not_confirmed' }).icon, row({ change: 'armed' }).icon, row({ change: 'paused' }).icon], ['crit', 'slow', 'info']);
});

test('the gauge: an arc from the ordered to the measured speed, its label away from the limit’s', () => {
  assert.match(orderMark(2.2, 2.9, 15, 11).d, /^M14\.\d .*A196 196 0 0 1 29\./);
  assert.equal(orderMark(2.2, null, 15, 11).d, '');
  assert.equal(orderMark(2.2, 2.2, 15, 11).d, '');
  assert.equal(orderMark(4, 2, 15, null).d, orderMark(2, 4, 15, null).d, 'faster ordered than driven: the same arc');
  assert.deepEqual([orderMark(2, 3, 15, 11).anchor, orderMark(2, 3, 15, 4).anchor], ['start', 'end']);
});
