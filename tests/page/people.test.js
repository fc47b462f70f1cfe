// The texts of who is on duty, of a hand-over, and of the attention queue: who is called next, and who requests control.

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { AddPerson } from '../../static/js/control/add-person.js';
import { chipOf } from '../../static/js/control/control-layout.js';
import { LeftNotice, dutyWords, initialsOf, partOf } from '../../static/js/control/duty-layout.js';
import { SHAPES, shapeOf } from '../../static/js/drive/mode-text.js';
import { endWords, leftLines, lineWords, markOf } from '../../static/js/control/handover-layout.js';
import { lastWords } from '../../static/js/control/people-layout.js';
import { requestItem, supervisorWords, unownedWords } from '../../static/js/shell/fleet-requests.js';

const AT = new Date(2026, 10, 19, 13, 58).getTime();
const me = { person: 'a', name: 'A. K.', role: 'operator', title: 'operator', device: 'Pixel', since_ms: AT };
const duty = (/** @type {any} */ more = {}) => /** @type {any} */ ({ kind: 'duty', me: null, signs: 'Pixel', ended: null, people: 3, on_duty: [], ...more });
const FREE = { holder: null, page: null, fence: null, former: null, requests: [] };
const MINE = { ...FREE, holder: 'A. K. (Pixel)', page: 'page-a', fence: 7 };

test('initials of names', () => {
  assert.deepEqual(['A. K.', 'Anna Maria Keller', 'anna', 'Ö', '山田 太郎', '<b>x</b>', '---', '𝒜 b'].map(initialsOf), ['AK', 'AK', 'A', 'Ö', '山太', 'B', '?', '𝒜B']);
});

test('the chip shows who is on duty and what they do', () => {
  assert.equal(chipOf(MINE, 'page-a', false, duty({ me })).text, 'AK controls');
  assert.equal(chipOf(MINE, 'page-a', false, duty()).text, 'You');
  assert.equal(chipOf(FREE, 'page-a', false, duty({ me })).text, 'AK on duty');
  assert.equal(chipOf(FREE, 'page-a', false, duty()).text, 'Sign on');
  assert.equal(chipOf(FREE, 'page-a', false, duty({ people: 0 })).text, 'No one');
  assert.equal(chipOf(MINE, 'page-b', false, duty({ me })).text, 'A. K. (Pixel)');
  assert.equal(chipOf(MINE, 'page-a', true, duty({ me })).text, '?');
});

test('who is on duty, and since when', () => {
  assert.equal(dutyWords(duty({ me })), 'A. K., operator: on duty since 13:58');
  assert.equal(dutyWords(null), 'On duty: not known');
  assert.equal(dutyWords(duty({ people: 0 })), 'Sign on: the list of people is empty');
  const row = (/** @type {number | null} */ last_ms) => lastWords(/** @type {any} */ ({ last_ms, duty: null }), AT);
  assert.deepEqual([row(null), row(AT - 60_000), row(AT - 20 * 3_600_000), row(AT - 3 * 86_400_000)], ['no shift yet', 'last shift today 13:57', 'last shift yesterday', 'last shift 16 Nov']);
});

test('a hand-over concerns two pages, and opens once all is read', (t) => {
  t.mock.timers.enable({ apis: ['Date'], now: AT });
  const handover = /** @type {any} */ ({ by: 'A', by_page: 'page-a', name: 'M. R.', page: 'page-b', since_ms: 0, lines: [{}, {}, {}], left: 1, version: 'x' });
  assert.deepEqual(['page-a', 'page-b', 'page-c', ''].map((page) => partOf(handover, page)), ['giver', 'taker', null, null]);
  assert.deepEqual(endWords(handover, 'taker'), { title: 'Take over control', text: '1 line not read back yet', isOpen: false });
  assert.equal(endWords({ ...handover, left: 0 }, 'taker').isOpen, true);
  assert.equal(endWords({ ...handover, left: 0 }, 'giver').isOpen, false, 'who hands over cannot take it for them');
  const line = (/** @type {any} */ more) => /** @type {any} */ ({ key: 'k', kind: 'alarm', title: 'Speed', text: '12 m/s', priority: null, since_ms: null, until_ms: null, read: false, ...more });
  assert.equal(lineWords(line({ since_ms: AT })), '12 m/s · began 13:58:00');
  assert.equal(lineWords(line({ since_ms: AT, text: 'Acknowledged by Ann.' })), 'Acknowledged by Ann · began 13:58:00');
  assert.equal(lineWords(line({ until_ms: AT, text: '' })), 'back at 13:58:00');
  assert.equal(lineWords(line({ since_ms: AT, off_duty_ms: AT + 60_000 })), '12 m/s, off duty since 13:59 · began 13:58:00');
  assert.deepEqual([line({ priority: 'critical' }), line({ priority: 'warning' }), line({ kind: 'shelved', priority: 'critical' })].map(markOf), ['crit', 'warn', 'bell-off']);
  const driving = (/** @type {string} */ key) => shapeOf(line({ kind: 'driving', key }));
  assert.deepEqual([driving('driving:autonomous:'), driving('driving:manual:'), driving('driving:unknown:silent'), shapeOf(line({}))], [SHAPES.autonomous, SHAPES.manual, '', ''], 'as in the ledge');
  assert.equal(markOf(line({ kind: 'driving' })), 'unknown');
});

test('who signs on is shown what people who are off duty left acknowledged, and not what is theirs', () => {
  const alarm = (/** @type {string} */ id, /** @type {any} */ more) => /** @type {any} */ ({ id, occurrence: 2, title: id, state: 'ACKED', active: true, verdict: 'fault', text: '12 m/s', priority: 'warning', raised_ms: AT, acknowledged_by: 'M. R. (Desk)', off_duty_ms: AT, ...more });
  const alarms = [alarm('left', {}), alarm('owned', { off_duty_ms: null }), alarm('mine', { acknowledged_by: 'A. K. (Desk)' }), alarm('again', { state: 'UNACKED' }), alarm('taken', { off_duty_ms: null, acknowledged_by: 'A. K. (Pixel)' })];
  const lines = leftLines(alarms, /** @type {any} */ (me), new Set(['taken 2']));
  assert.deepEqual(lines.map(({ key, read }) => [key, read]), [['left 2', false], ['taken 2', true]]);
  assert.equal(lines[0]?.text, '12 m/s. Acknowledged by M. R. (Desk).');
});

test('the queue shows whose alarms are left without an owner on duty', (t) => {
  t.mock.timers.enable({ apis: ['Date'], now: AT });
  const of = (/** @type {any} */ unowned) => unownedWords(/** @type {any} */ ({ unowned }));
  assert.equal(of({ count: 1, by: 'A. K. (Pixel)', since_ms: AT }), 'acknowledged by A. K. (Pixel), off duty since 13:58');
  assert.equal(of({ count: 3, by: 'A. K. (Pixel)', since_ms: AT }), '3 alarms acknowledged by A. K. (Pixel), off duty since 13:58');
  assert.equal(of({ count: 1, by: 'A. K. (Pixel)', since_ms: AT - 86_400_000 }), 'acknowledged by A. K. (Pixel), off duty since 18 Nov, 13:58');
  assert.deepEqual([of(null), of(undefined)], ['', '']);
});

test('an item goes on to who is on duty, or shows that nobody is', () => {
  const item = (/** @type {any} */ more) => /** @type {any} */ ({ since_ms: 0, assigned: null, offered: null, escalates_ms: null, escalated_ms: null, ...more });
  assert.equal(supervisorWords(item({ escalated_ms: 0, supervisors: ['J. D.'] }), 11_000), 'escalated to J. D. for 0:11');
  assert.equal(supervisorWords(item({ escalated_ms: 0, supervisors: [] }), 11_000), 'escalated: no supervisor is on duty, 0:11');
  assert.equal(supervisorWords(item({ escalated_ms: 0, supervisors: null }), 11_000), 'at Supervisor for 0:11');
  assert.equal(supervisorWords(item({ escalates_ms: 4000, supervisors: ['J. D.', 'K. L.'] }), 0), 'J. D., K. L. in 0:04');
  assert.equal(supervisorWords(item({ escalates_ms: 4000, supervisors: [] }), 0), 'Supervisor in 0:04: none on duty');
  assert.equal(supervisorWords(item({}), 0), '');
});

test('a request for control that nobody answers is an item', () => {
  const summary = (/** @type {any} */ more) => /** @type {any} */ ({ holder: 'Ann', requests: [{ page: 'b', name: 'Ben', left_s: 7.2 }], ...more });
  const one = requestItem('ocelot', summary({}), 1.0);
  assert.deepEqual([one?.key, one?.title, one?.detail], ['ocelot control', 'Ben requests control', 'Granted in 7 s unless Ann keeps it']);
  assert.equal(requestItem('ocelot', summary({ requests: [] }), 0), null);
  assert.equal(requestItem('ocelot', summary({ requests: undefined }), 0), null, 'an older agent does not state it');
  assert.match(requestItem('ocelot', summary({ requests: [{ page: 'b', name: 'Ben', left_s: 1 }, { page: 'c', name: 'Cem', left_s: 5 }] }), 9)?.detail ?? '', /Granted in 0 s .* 1 other request/);
});

test('what others left is shown once in a duty, where it is known within 10 s of its beginning', () => {
  const notice = new LeftNotice();
  const found = (/** @type {boolean} */ isLeft, /** @type {number} */ now_ms, since_ms = AT) => notice.isDue(since_ms, isLeft, now_ms);
  assert.deepEqual([found(false, 0), found(true, 1_500), found(false, 2_000), found(true, 60_000)], [false, true, false, true]); // it waits while it may not open
  notice.isShown = true;
  assert.equal(found(true, 61_000), false);
  assert.deepEqual([found(false, 70_000, AT + 1), found(true, 80_001, AT + 1)], [false, false]); // left later
  assert.equal(found(true, 90_000, AT + 2), true);
});

test('a name of who was removed is added by a second press that was meant', async (t) => {
  let now_ms = 1000;
  /** @type {unknown[]} */
  const sent = [];
  let status = 409;
  t.mock.method(performance, 'now', () => now_ms);
  t.mock.method(globalThis, 'fetch', async (/** @type {string} */ _, /** @type {{body: string}} */ { body }) => {
    sent.push(JSON.parse(body));
    if (!status) throw new TypeError('no network');
    return { ok: status === 200, status, json: async () => (status === 200 ? { people: [] } : { detail: 'A. K. was removed lately.' }) };
  });
  const adding = new AddPerson(/** @type {any} */ ({ dataset: {} }));
  const press = (/** @type {string} */ name) => adding.add({ name }, /** @type {any} */ ({ timeStamp: now_ms })).catch(({ message }) => message);
  status = 0;
  await press('A. K.');
  now_ms += 1000;
  status = 409;
  assert.equal(await press('A. K.'), 'A. K. was removed lately.', 'what never arrived was not refused');
  now_ms += 399;
  await press('A. K.'); // a second press of the same tap
  now_ms += 1000;
  await press('B. K.');
  now_ms += 1000;
  await press('A. K.'); // another name was refused last
  now_ms += 1000;
  status = 200;
  assert.deepEqual(await press('A. K.'), { people: [] });
  assert.deepEqual(sent, ['A. K.', 'A. K.', 'A. K.', 'B. K.', 'A. K.', 'A. K.'].map((name, i) => ({ name, returns: i === 5 })));
});
