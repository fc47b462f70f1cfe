import assert from 'node:assert/strict';
import { test } from 'node:test';
import { isLess } from '../../static/js/shell/cars-alarms.js';
import { alone, announcedOf, askingOf, badgeOf, keyOf, louder, rowsOf, shortNames } from '../../static/js/shell/cars-layout.js';
import { alarm, state } from './frames.js';

const worst = (more = {}) => ({ id: 'speed_limit', occurrence: 3, title: 'Speed above limit', priority: 'critical', state: 'UNACKED', active: true, raised_ms: 93_000, sound: 'high', ...more });
const summary = (more = {}) => ({
  phase: 'monitoring', paused: false, link: { cut: null, bridge_age_s: 0.1, car_age_s: 0.1, trying_for_s: 0, connected_for_s: 60 }, worst: null, waiting: 0,
  speed: { value_mps: 4.2, freshness: 'fresh', age_s: 0.1, horizon_s: 1 }, holder: null, page: null, recording: 'recording', recording_for_s: 252, slow_down: 'not_armed', ...more,
});
/** @param {Record<string, any>} all @param {number} [lag_s] */
const rows = (all, lag_s = 0.1) => rowsOf(/** @type {any} */ ({
  kind: 'cars', time_ms: 100_000, cars: Object.entries(all).map(([name, one]) => ({ name, age_s: one ? 0.1 : 41, summary: one })),
}), lag_s, 'my-page');

test('a short name has at most 8 characters, keeps its number, and no two are alike', () => {
  const names = ['Ocelot', 'kodkod_2', 'catvehicle-1', 'catvehicle-12', 'catvehicle', 'catvehicles', 'catvehic', 'CATVEHICLE', 'test-vehicle-7', 'test-vehiculum-7'];
  const short = shortNames(names);
  assert.deepEqual(['Ocelot', 'kodkod_2', 'catvehicle-1', 'catvehicle-12', 'catvehic'].map((name) => short.get(name)), ['Ocelot', 'kodkod 2', 'catveh 1', 'catve 12', 'catvehic']);
  const all = [...short.values()];
  assert.equal(new Set(all.map((one) => one.toLowerCase())).size, names.length, all.join());
  assert.ok(all.every((one) => one.length > 0 && one.length <= 8), all.join());
});

test('forty cars of one long name are still distinguished', () => {
  const all = [...shortNames(Array.from({ length: 40 }, (_, i) => `expedition-vehicle-${'abcdefgh'[i % 8]}x${i}y`)).values()];
  assert.equal(new Set(all).size, 40);
  assert.ok(all.every((one) => one.length <= 8));
});

test('the car that needs a person most comes first', () => {
  const order = rows({
    calm: summary(), idle: summary({ phase: 'idle' }), acked: summary({ worst: worst({ state: 'ACKED' }), waiting: 0 }), gone: null,
    ended: summary({ worst: worst({ state: 'RTN_UNACKED', active: false }), waiting: 1 }), lost: summary({ phase: 'lost' }),
    warned: summary({ worst: worst({ priority: 'warning' }), waiting: 1 }), speeding: summary({ worst: worst(), waiting: 2 }), newest: summary({ worst: worst({ raised_ms: 99_000 }), waiting: 1 }),
  }).map(({ name }) => name);
  assert.deepEqual(order, ['newest', 'speeding', 'gone', 'warned', 'ended', 'acked', 'lost', 'calm', 'idle']);
});

test('a row shows what needs an answer, for how long, who is in control, and how old its speed is', () => {
  const [one] = rows({ serval: summary({ worst: worst(), waiting: 2, holder: 'Ann', page: 'my-page' }) });
  assert.equal(one?.text, 'Speed above limit, 7.1 s +1');
  assert.deepEqual([one?.operator, one?.speed, one?.chain?.state, one?.isFilled, one?.recording], ['You', { ink: 'fresh', value_mps: 4.2 }, 'Live', true, '04:12']);
  assert.equal(rows({ serval: summary({ worst: worst({ active: false, state: 'RTN_UNACKED' }) }) })[0]?.text, 'Speed above limit: ended', 'an older agent');
  assert.equal(rows({ serval: summary({ worst: worst({ active: false, state: 'RTN_UNACKED', ended_title: 'The car was silent' }) }) })[0]?.text, 'The car was silent');
  assert.equal(rows({ serval: summary({ worst: worst({ state: 'ACKED' }) }) })[0]?.text, 'Speed above limit, acknowledged');
});

test('a car whose session stopped is unknown, its age grows, and no value of before looks fresh', () => {
  const [one] = rows({ serval: null });
  assert.deepEqual([one?.text, one?.speed, one?.needs, one?.operator], ['Not known for 41.1 s', { ink: 'never', value_mps: null }, true, '?']);
  const [late] = rows({ serval: summary() }, 3);
  assert.deepEqual([late?.text, late?.chain], ['Not known for 3.1 s', null], 'the list itself may be old');
  assert.equal(rows({ serval: summary() }, 1.5)[0]?.speed.ink, 'stale');
  assert.equal(rows({ serval: summary({ phase: 'lost' }) })[0]?.speed.ink, 'stale');
});

test('the badge counts other cars that need a person, in the shape of the worst', () => {
  const all = rows({ own: summary({ worst: worst(), waiting: 1 }), a: summary({ worst: worst({ priority: 'warning' }), waiting: 1 }), b: summary({ worst: worst({ state: 'ACKED' }) }), c: summary({ worst: worst({ priority: 'advisory' }), waiting: 1 }) });
  assert.deepEqual(badgeOf(all, 'own'), { count: 1, icon: 'warn', kind: 'warn', isFilled: true });
  assert.equal(badgeOf(all, 'a')?.icon, 'crit');
  assert.equal(badgeOf(rows({ own: summary(), a: summary() }), 'own'), null);
});

test('an alarm that was left is not shown again for this occurrence, and is for the next one', () => {
  const now = rows({ own: summary(), serval: summary({ worst: worst(), waiting: 1 }) });
  const left = new Set(askingOf(now, 'own', new Set()).map(keyOf));
  assert.deepEqual([left.size, askingOf(now, 'own', left).length, askingOf(now, 'serval', new Set()).length], [1, 0, 0]);
  assert.equal(askingOf(rows({ own: summary(), serval: summary({ worst: worst({ occurrence: 4 }) }) }), 'own', left).length, 1);
});

test('the next alarm of another car sounds on a phone only where it would announce it', () => {
  const of = (/** @type {any} */ more, isLeft = false, lag_s = 0.1) => {
    const all = rows({ own: summary(), serval: summary(more && { worst: worst(more) }) }, lag_s);
    return announcedOf(all, 'own', new Set(isLeft ? all.map(keyOf) : []));
  };
  /** @type {Array<[any, boolean, number, boolean, string]>} */
  const cases = [
    [null, false, 0.1, true, 'no alarm'],
    [{}, false, 0.1, true, 'it sounds now'],
    [{}, true, 0.1, false, 'a critical one was left: a warning would not sound'],
    [{ sound: 'none' }, false, 0.1, false, 'silenced'],
    [{ priority: 'warning' }, true, 0.1, true, 'a warning that was left: the next one sounds'],
    [{ state: 'ACKED' }, true, 0.1, true, 'acknowledged'],
    [{ state: 'RTN_UNACKED', active: false }, true, 0.1, true, 'ended'],
    [null, false, 3, false, 'the list is old'],
  ];
  for (const [more, isLeft, lag_s, is, why] of cases) assert.deepEqual(of(more, isLeft, lag_s), is ? ['serval'] : [], why);
  assert.deepEqual(announcedOf(rows({ own: summary(), serval: null, b: summary(), a: summary() }), 'own', new Set()), ['a', 'b']);
});

test('the louder sound plays, and the count-down of this car above all', () => {
  const asking = rows({ serval: summary({ worst: worst() }) });
  assert.deepEqual([louder(null, asking), louder('medium', asking), louder('count', asking), louder('low', []), louder(null, [])], ['high', 'high', 'count', 'low', null]);
  assert.equal(louder('high', rows({ serval: summary({ worst: worst({ sound: 'medium' }) }) })), 'high');
});

test('the strip names another car only where this one has nothing worse', () => {
  assert.deepEqual([isLess('', 'crit'), isLess('warn', 'crit'), isLess('crit', 'crit'), isLess('order', 'crit'), isLess('invert', 'crit')], [true, true, false, false, false]);
  assert.deepEqual([isLess('', 'warn'), isLess('warn', 'warn'), isLess('', '')], [true, false, false]);
});

test('one car alone is listed from its own state', () => {
  const frame = state({ alarms: [alarm({ state: 'ACKED', priority: 'warning', id: 'a' }), alarm()], control: { holder: 'Ann', page: 'p' } });
  const [row, ...none] = rowsOf(alone(frame), 0.1, 'p');
  assert.deepEqual([row?.name, row?.operator, row?.worst?.id, none.length, rowsOf(alone(null), 0, '').length], ['car', 'You', 'speed_limit', 0, 0]);
});
