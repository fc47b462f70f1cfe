import assert from 'node:assert/strict';
import { test } from 'node:test';
import { grouped, headOf, itemsOf, loudest, natural, rangeOf, timerLength, withEvent } from '../../static/js/shell/fleet-layout.js';
import { carRows, foldedRows, labelsOf, lineOf, placesOf, rowsAPage } from '../../static/js/shell/fleet-rows-layout.js';
import { dotsOf, mapWords, namesAt, stepOf, viewOf } from '../../static/js/shell/fleet-map-layout.js';
import { lostChain, lostWords } from '../../static/js/shell/fleet-lost.js';

const NOW = 1_000_000;
const person = (page, name = page) => ({ page, name, since_ms: NOW - 5000 });
const worst = (more = {}) => ({ id: 'speed_limit', occurrence: 1, title: 'Speed above limit', priority: 'critical', state: 'UNACKED', active: true, raised_ms: NOW - 7000, sound: 'high', text: '12.6 m/s, limit 11.0 m/s', ...more });
const item = (more = {}) => ({ since_ms: NOW - 7000, assigned: null, offered: null, escalates_ms: NOW + 23_000, escalated_ms: null, ...more });
const summary = (more = {}) => ({
  phase: 'monitoring', paused: false, link: { cut: null, bridge_age_s: 0.1, car_age_s: 0.1, trying_for_s: 0, connected_for_s: 60 }, worst: null, waiting: 0,
  speed: { value_mps: 4.2, freshness: 'fresh', age_s: 0.1, horizon_s: 1 }, holder: null, page: null, recording: 'recording', recording_for_s: 252, slow_down: 'not_armed',
  attention: null, place: null, energy_percent: 64, people: [], ...more,
});
const needy = (more = {}, of = {}) => summary({ worst: worst(of), waiting: 1, attention: item(more) });
/** @param {Record<string, any>} cars @param {any} [more] @returns {any} */
const seen = (cars, more = {}) => ({
  cars: { kind: 'cars', time_ms: NOW, cars: Object.entries(cars).map(([name, one]) => ({ name, age_s: one === undefined ? null : one ? 0.1 : 41, summary: one ?? null })) },
  lag_s: 0, now_ms: NOW, kept: new Map(Object.entries(cars).filter(([, one]) => one).map(([name, one]) => [name, { summary: one, at_ms: 0 }])), page_ms: 0, wall_ms: NOW, page: 'me', ...more,
});
const keysOf = (/** @type {any} */ one) => one.keys.map(({ label }) => label).join();

test('who was not taken in time comes first, then the least time left, then what somebody has', () => {
  const order = itemsOf(seen({
    calm: summary(), mine: needy({ assigned: person('me'), escalates_ms: null }), soon: needy({ escalates_ms: NOW + 4000 }), later: needy(), gone: null,
    up: needy({ escalates_ms: null, escalated_ms: NOW - 11_000 }), acked: needy({ assigned: person('other', 'Desk 2'), escalates_ms: null }, { state: 'ACKED' }),
    asked: needy({ assigned: person('other', 'Desk 2'), offered: { by: 'Desk 2', name: 'Me', page: 'me', since_ms: NOW }, escalates_ms: null }),
    warned: needy({ escalates_ms: null }, { priority: 'warning' }),
  }));
  assert.deepEqual(order.map(({ name }) => name), ['up', 'soon', 'later', 'gone', 'asked', 'warned', 'acked', 'mine']);
  const texts = Object.fromEntries(order.map((one) => [one.name, `${one.who.text} | ${one.next} | ${keysOf(one)}`]));
  assert.equal(texts['up'], 'unassigned | at Supervisor for 0:11 | Take it,Hand over');
  assert.equal(texts['soon'], 'unassigned | Supervisor in 0:04 | Take it,Hand over');
  assert.equal(texts['mine'], 'assigned to you | no timer | Open,Hand over,Unassign');
  assert.equal(texts['asked'], 'offered to you by Desk 2 | offered 0:00 ago | Accept,Decline');
  assert.equal(texts['acked'], 'assigned to Desk 2, acknowledged | no timer | Take over');
  assert.equal(order.find(({ name }) => name === 'gone')?.title, 'No data: car may be moving');
  assert.equal(headOf(order, order.length), '8 · 4 unassigned');
});

test('a car that is off on purpose is in no count and sounds nothing, and shows who set it', () => {
  const of = seen({ a: undefined, b: undefined }, { kept: new Map([['a', { summary: summary(), at_ms: 0 }], ['b', { summary: summary(), at_ms: 0 }]]) });
  const [a, b] = of.cars.cars;
  Object.assign(a, { trouble: 'The agent of a does not answer.', age_s: 41 });
  Object.assign(b, { trouble: 'The agent of b does not answer.', age_s: 41, off: { by: 'Ann', since_ms: NOW - 60_000 } });
  const [lost, off] = itemsOf(of);
  assert.deepEqual([lost?.name, lost && keysOf(lost), lost?.sound], ['a', 'Open,Silence,It is off', 'high']);
  assert.deepEqual([off?.isOff, off && keysOf(off), off?.sound, off?.since_s, off?.kind], [true, 'Not off', 'none', 60, '']);
  assert.match(off?.who.text ?? '', /^set by Ann at /);
  const row = carRows(of, ['a'], null).find(({ name }) => name === 'b');
  assert.deepEqual([row?.text, row?.kind, row?.isLost, row?.isAsking], ['Off on purpose', '', false, false]);
});

test('what somebody acknowledged who is off duty needs an answer like what nobody has', (t) => {
  t.mock.timers.enable({ apis: ['Date'], now: NOW });
  const unowned = { count: 1, by: 'A. K. (Pixel)', since_ms: NOW - 60_000 };
  const acked = (/** @type {any} */ more) => summary({ worst: worst({ state: 'ACKED', priority: 'warning' }), attention: item({ escalates_ms: null }), ...more });
  const of = seen({ a: acked({}), b: acked({ unowned }) });
  const [first] = itemsOf(of);
  assert.equal(first?.name, 'b');
  assert.match(first?.detail ?? '', /^12\.6 m\/s, limit 11\.0 m\/s; acknowledged by A\. K\. \(Pixel\), off duty since \d\d:\d\d$/);
  const rows = Object.fromEntries(carRows(of, ['b', 'a'], null).map(({ name, text }) => [name, text]));
  assert.match(rows['b'] ?? '', /^.+ · owner off duty$/);
  assert.doesNotMatch(rows['a'] ?? '', /off duty/);
});

test('the timer fills over 30 s by the clock of the car, and stays full once it went on', () => {
  const [one] = itemsOf(seen({ a: needy() }));
  assert.ok(Math.abs((one?.timer?.share ?? 0) - 7 / 30) < 0.01);
  assert.deepEqual(itemsOf(seen({ a: needy({ escalates_ms: null, escalated_ms: NOW - 1 }) }))[0]?.timer, { share: 1, isUp: true });
  const other = needy();
  const [late] = itemsOf(seen({ a: { ...other, time_ms: NOW } }, { now_ms: NOW + 3_600_000, lag_s: 2 }));
  assert.equal(late?.since_s, 9.1, 'an hour between the clocks of server and agent changes nothing');
});

test('the length of a timer is what was left of it when it began', () => {
  const before = { summary: summary() };
  assert.equal(timerLength(before, /** @type {any} */ (needy({ escalates_ms: NOW + 60_000 })), NOW), 60);
  assert.equal(timerLength(undefined, /** @type {any} */ (needy({ escalates_ms: NOW + 4000 })), NOW), 30, 'it ran already');
  assert.equal(timerLength({ summary: /** @type {any} */ (needy({ escalates_ms: NOW + 9000 })), timer_s: 60 }, /** @type {any} */ (needy({ escalates_ms: NOW + 9000 })), NOW), 60);
});

test('an offer of mine can be withdrawn, and a car whose agent states no item is only opened', () => {
  const offered = { by: 'Me', name: 'Desk 2', page: 'desk2', since_ms: NOW - 3000 };
  const [one] = itemsOf(seen({ a: needy({ assigned: person('me'), offered, escalates_ms: null }) }));
  assert.equal(`${one?.who.text} | ${keysOf(one)}`, 'assigned to you, offered to Desk 2 | Open,Withdraw');
  const { attention, ...old } = needy();
  assert.equal(keysOf(itemsOf(seen({ a: old }))[0]), 'Open');
  assert.deepEqual(itemsOf(seen({ a: summary({ attention: undefined }) })), []);
});

test('a car that never sent data is listed, and needs nobody', () => {
  const all = seen({ a: undefined, b: summary() });
  assert.deepEqual(itemsOf(all), []);
  const rows = carRows(all, [], null);
  assert.deepEqual(rows.map(({ name, text, kind, icon, isAsking }) => [name, text, kind, icon, isAsking]), [['a', 'No data yet', '', 'unknown', false], ['b', '–', '', 'ok', false]]);
  assert.equal(lineOf([], [], 0, rows).end, '1 of 2 not monitored');
});

test('what is unassigned sounds, and nothing else', () => {
  assert.equal(loudest(itemsOf(seen({ a: needy(), b: needy({}, { sound: 'medium', priority: 'warning' }) }))), 'high');
  assert.equal(loudest(itemsOf(seen({ a: needy({ assigned: person('other') }) }))), 'none');
  assert.equal(loudest(itemsOf(seen({ a: needy({}, { state: 'ACKED' }) }))), 'none');
});

test('a car that fell silent sounds until it is silenced, and one whose monitoring had ended does not', () => {
  const gone = { a: null };
  const [loud] = itemsOf(seen(gone));
  assert.deepEqual([loud?.sound, keysOf(loud)], ['high', 'Open,Silence']);
  const [hushed] = itemsOf(seen(gone, { hushed: new Set(['a']) }));
  assert.deepEqual([hushed?.sound, keysOf(hushed)], ['none', 'Open']);
  const idle = new Map([['a', { summary: summary({ phase: 'idle' }), at_ms: 0 }]]);
  assert.equal(itemsOf(seen(gone, { kept: idle }))[0]?.sound, 'none');
  const many = Object.fromEntries(Array.from({ length: 11 }, (_, i) => [`C${i}`, null]));
  assert.equal(keysOf(grouped(itemsOf(seen(many)), new Set()).items[0]), 'Silence all,Show 11');
  assert.equal(keysOf(grouped(itemsOf(seen(many, { hushed: new Set(Object.keys(many)) })), new Set()).items[0]), 'Show 11');
});

const flooded = (/** @type {number} */ count, more = {}) => Object.fromEntries(Array.from({ length: count }, (_, i) => [`C${34 + i}`, needy(more)]));

test('over ten cars with one cause are one item and one row, and unfold', () => {
  const few = itemsOf(seen(flooded(10)));
  assert.equal(grouped(few, new Set()).items.length, 10);
  const all = seen({ ...flooded(31), C07: needy({}, { id: 'obstacle', title: 'Obstacle' }) });
  const items = itemsOf(all);
  const { items: shown, folded, flood } = grouped(items, new Set());
  assert.deepEqual(shown.map(({ name, detail }) => `${name} ${detail}`), ['C07 12.6 m/s, limit 11.0 m/s', '31 cars C34 to C64']);
  const group = shown[1];
  assert.deepEqual([keysOf(group), group?.who.text, flood], ['Take all,Hand over,Show 31', 'unassigned', 31]);
  const rows = carRows(all, items.map(({ name }) => name), null);
  assert.equal(foldedRows(rows, folded, new Set()).length, 2);
  const open = new Set([/** @type {any} */ (group).key]);
  assert.equal(grouped(items, open).items.length, 33);
  assert.equal(foldedRows(rows, folded, open).length, 33);
  assert.equal(keysOf(grouped(items, open).items[1]), 'Take all,Hand over,Hide 31');
  assert.equal(headOf(items, shown.length), '32 in 2 groups · 32 unassigned');
  assert.equal(lineOf(items, shown, flood, rows).end, 'flood: 31');
  const silent = seen(flooded(31));
  for (const { summary: of } of silent.cars.cars) of.link.cut = 2;
  const each = itemsOf(silent);
  const { items: one, ...all31 } = grouped(each, new Set());
  const line = lineOf(each, one, all31.flood, rows);
  assert.equal(each[0]?.title, 'Speed above limit, car may move');
  assert.equal(`${line.text} | ${line.end} ${line.more}`, '31 cars: Speed above limit, cars may move |  flood · 31 unassigned', 'the number is said once');
  assert.equal(foldedRows(carRows(silent, each.map(({ name }) => name), null), all31.folded, new Set())[0]?.text, 'Speed above limit: C34 to C64');
});

test('in a flood a question to this page stays apart, old alarms do not count, and what I took is a group of mine', () => {
  const offered = needy({ assigned: person('other'), offered: { by: 'Desk 2', name: 'Me', page: 'me', since_ms: NOW }, escalates_ms: null });
  assert.equal(grouped(itemsOf(seen({ ...flooded(12), offered })), new Set()).items.length, 2);
  const old = flooded(12);
  for (const one of Object.values(old)) /** @type {any} */ (one).worst.raised_ms = NOW - 601_000;
  assert.equal(grouped(itemsOf(seen(old)), new Set()).items.length, 12);
  const mine = grouped(itemsOf(seen(flooded(12, { assigned: person('me'), escalates_ms: null }))), new Set()).items;
  assert.deepEqual(mine.map(keysOf), ['Unassign all,Show 12']);
});

test('a row shows what is known, and nothing of before as if it were now', () => {
  const [calm] = carRows(seen({ a: summary() }), [], null);
  assert.deepEqual([calm?.text, calm?.mode, calm?.operator, calm?.age, calm?.energy.text, calm?.isQuiet], ['–', 'driving', 'No one', '0.2', '64', true]);
  const standing = summary({ speed: { value_mps: 0.02, freshness: 'fresh', age_s: 0.1, horizon_s: 1 } });
  assert.equal(carRows(seen({ a: standing }), [], null)[0]?.mode, 'standing');
  const late = carRows(seen({ a: summary({ holder: 'Ann' }) }, { lag_s: 3.2 }), [], null)[0];
  assert.deepEqual([late?.text, late?.mode, late?.speed.ink, late?.operator, late?.isLost, late?.energy.ink], ['No data', 'unknown', 'stale', 'Ann?', true, 'stale']);
  assert.deepEqual(carRows(seen({ b: summary(), a: needy() }), [], 'cars').map(({ name, text, mode }) => `${name} ${text} ${mode}`), ['a not known now unknown', 'b not known now unknown']);
  const cuts = (/** @type {any} */ lost) => carRows(seen({ b: summary() }), [], lost).map(({ chain }) => chain.cut);
  assert.deepEqual([cuts('cars'), cuts('server')], [[1], [0]], 'where the bar has it');
  assert.equal(carRows(seen({ a: needy({}, { state: 'ACKED' }) }), ['a'], null)[0]?.text, 'Speed above limit');
});

test('rows stand in the order of the queue, then by name as people count', () => {
  const all = seen({ C10: summary(), C2: summary(), C1: needy(), C3: needy({ escalates_ms: NOW + 1000 }) });
  assert.deepEqual(carRows(all, itemsOf(all).map(({ name }) => name), null).map(({ name }) => name), ['C3', 'C1', 'C2', 'C10']);
  assert.ok(natural('C2', 'C10') < 0);
});

test('nothing needs a person is shown only of cars that are monitored', () => {
  const line = (/** @type {any} */ cars) => lineOf([], [], 0, carRows(seen(cars), [], null));
  assert.deepEqual([line({ a: summary() }).text, line({ a: summary() }).icon, line({ a: summary() }).end], ['Nothing needs a person', 'ok', '']);
  assert.deepEqual([line({ a: summary(), b: summary({ phase: 'idle' }) }).icon, line({ a: summary(), b: summary({ paused: true }) }).end], ['unknown', '1 of 2 not monitored']);
  assert.equal(line({}).text, 'No car is listed yet');
});

test('each car has one place in the grid, named by its number where that tells it apart', () => {
  assert.deepEqual(labelsOf(['C01', 'C02']), ['01', '02']);
  assert.deepEqual(labelsOf(['Ocelot', 'C02']), ['Ocelot', 'C02']);
  const rows = carRows(seen({ b: null, a: needy(), c: summary() }), ['a', 'b'], null);
  assert.deepEqual(placesOf(rows).map(({ name, kind, title }) => `${name} ${kind} ${title}`), ['a crit a, Speed above limit', 'b lost b, no data', 'c  c, driving']);
  const [known] = placesOf(carRows(seen({ a: summary({ worst: worst({ state: 'ACKED' }) }) }), [], null));
  assert.deepEqual([known?.kind, known?.isKnown], ['crit', true], 'it stands, though it was acknowledged');
  assert.equal(placesOf(rows)[0]?.isKnown, false);
  const cut = (/** @type {any} */ state) => placesOf(carRows(seen({ a: summary({ phase: 'lost', worst: worst({ state }) }) }), [], null)).map(({ kind, isKnown }) => [kind, isKnown])[0];
  assert.deepEqual([cut('UNACKED'), cut('ACKED')], [['lost', false], ['lost', true]], 'also of a car whose connection is lost');
});

test('a range names a row of numbers, else the first few', () => {
  assert.equal(rangeOf(['C34', 'C35', 'C36']), 'C34 to C36');
  assert.equal(rangeOf(['C34', 'C36', 'C37']), 'C34, C36, C37');
  assert.equal(rangeOf(['a', 'b', 'c', 'd', 'e', 'f', 'g', 'h']), 'a, b, c, d, e and 3 more');
  assert.equal(rowsAPage(100, 772, 28, 270), 16);
  assert.equal(rowsAPage(5, 772, 40, 260), 5);
  assert.equal(rowsAPage(100, 300, 28, 270), 4);
});

const place = (/** @type {number} */ north_m, more = {}) => ({ lat_deg: 48 + north_m / 111_200, lon_deg: 11, heading_rad: Math.PI / 2, freshness: 'fresh', age_s: 0.1, ...more });

test('cars stand on one plane, and one without a position or far away is named', () => {
  const all = seen({ a: summary({ place: place(0) }), b: summary({ place: place(300) }), c: summary(), d: summary({ place: place(200_000) }), e: summary({ place: place(10, { freshness: 'stale', age_s: 41 }) }) });
  const { dots, far, without, from } = dotsOf(all, new Map([['a', 'crit']]), new Set(), null);
  assert.deepEqual(dots.map(({ name, isLive, kind }) => `${name} ${isLive} ${kind}`), ['a true crit', 'b true ', 'e false ']);
  assert.deepEqual([far, without], [['d'], ['c']]);
  assert.ok(Math.abs((dots[1]?.north_m ?? 0) - 300) < 1 && dots[0]?.turn_deg === 0);
  assert.equal(mapWords(5, dots, without, far), '5 cars, 1 last seen 0:41 ago, 1 car without a position, 1 farther than 50 km');
  assert.ok(from);
  const view = viewOf(dots, 600, 400, null);
  assert.equal(viewOf(dots.map((dot) => ({ ...dot, north_m: dot.north_m + 3 })), 600, 400, view), view, 'the picture holds while cars move within it');
  assert.notEqual(viewOf(dots.map((dot) => ({ ...dot, north_m: dot.north_m * 9 })), 600, 400, view), view);
  assert.equal(stepOf({ east_m: 0, north_m: 0, m_per_px: 1 }), 100);
  assert.ok(viewOf([], 600, 400, null).m_per_px > 0);
});

test('no name on the map covers another or a car', () => {
  const wanted = Array.from({ length: 6 }, (_, i) => ({ name: `n${i}`, x: 100 + 4 * i, y: 100, width: 60, around: 10 }));
  const names = namesAt(wanted, wanted, 300, 200);
  assert.ok(names.size >= 2 && names.size < 6);
  assert.equal(names.get('n0')?.anchor, 'end');
});

test('what is lost is named, the server or what is beyond it', () => {
  const lost = { silence_s: 9.4, heard_ms: NOW, cars: 5, unserved: '' };
  assert.deepEqual(lostChain({ ...lost, lost: 'server' }).nodes.map(({ mark }) => mark), ['here', 'silent 9.4 s', 'unknown', 'unknown']);
  assert.equal(lostChain({ ...lost, lost: 'cars' }).cut, 1);
  assert.equal(lostChain({ ...lost, lost: 'cars' }).nodes[0]?.name, 'This device'); // as on the page of one car
  assert.match(lostWords({ ...lost, lost: 'server' })[0], /^The server stopped answering\. Last data at/);
  assert.match(lostWords({ ...lost, lost: 'cars', unserved: 'The broker is not connected.' }).join(' '), /broker is not connected.*alarms of 5 cars do not arrive/);
});

test('events are kept once each, the newest first', () => {
  const event = (/** @type {number} */ n) => /** @type {any} */ ({ kind: 'fleet_event', vehicle: 'a', n, time_ms: n, text: 't', by: null });
  let events = /** @type {any[]} */ ([]);
  for (const n of [3, 1, 2, 2]) events = withEvent(events, event(n));
  assert.deepEqual(events.map(({ n }) => n), [3, 2, 1]);
});
