import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Emitter } from '../../static/js/core/emitter.js';
import { EventLog } from '../../static/js/core/event-log.js';
import { challengeOf, controlOf, fenceOf, liveOf } from '../../static/js/core/live-car.js';
import { LogSync } from '../../static/js/core/log-sync.js';
import { laterWords } from '../../static/js/core/outcome.js';
import { Requests } from '../../static/js/core/requests.js';
import { ScanFeed } from '../../static/js/core/scan-feed.js';
import { state } from './frames.js';

test('a listener that throws is a failure, and stops none of the others', () => {
  /** @type {unknown[]} */
  const failed = [];
  const received = /** @type {string[]} */ ([]);
  const emitter = new Emitter((error) => failed.push(error));
  emitter.on('draw', () => { throw new Error('a broken panel'); });
  const off = emitter.on('draw', (detail) => received.push(detail));
  emitter.emit('draw', 'one');
  off();
  emitter.emit('draw', 'two');
  assert.deepEqual([received, failed.length], [['one'], 2]);
});

const NOT_SENT = { ok: false, outcome: 'not_delivered', reason: 'Not sent: the server does not answer.', isBroken: true };

test('a request is answered once, not sent where it cannot be, and not known when no answer comes', async (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const sent = /** @type {any[]} */ ([]);
  const refused = /** @type {(string | undefined)[]} */ ([]);
  let isOpen = false;
  const requests = new Requests((message) => isOpen && Boolean(sent.push(message)), ({ reason }) => refused.push(reason));
  assert.deepEqual(await requests.ask('pause', {}), NOT_SENT);
  isOpen = true;
  const first = requests.ask('pause', { fence: 7 });
  const { id } = sent[0];
  assert.deepEqual(sent[0], { kind: 'pause', id, fence: 7 });
  requests.answered(/** @type {any} */ ({ kind: 'reply', id, ok: false, reason: 'Not now.', held_by: 'Ann', conflict: true }));
  assert.deepEqual(await first, { ok: false, reason: 'Not now.', isConflict: true, heldBy: 'Ann' });
  const second = requests.ask('pause', {});
  requests.broke();
  const cut = 'It may have been carried out. The link is cut between this page and the server. Not known yet in which direction.';
  const broken = `The connection to the server broke. ${cut}`;
  assert.deepEqual(await second, { ok: false, outcome: 'unknown', reason: broken, isBroken: true });
  const third = requests.ask('pause', {}, 100);
  t.mock.timers.tick(100);
  const late = `The server did not answer in time. ${cut}`;
  assert.equal((await third).reason, late);
  assert.deepEqual(refused, ['Not now.', broken, late]);
});

test('its outcome is queried since the moment of the request, not since it was given up', async (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  let now_ms = 50_000;
  t.mock.method(performance, 'now', () => now_ms);
  const sent = /** @type {any[]} */ ([]);
  const requests = new Requests((message) => Boolean(sent.push(message)), () => {});
  const answer = requests.ask('pause', {});
  now_ms += 4000;
  t.mock.timers.tick(4000);
  await answer;
  requests.look(now_ms + 1000);
  assert.equal(sent[1].ago_s, 5);
});

test('what became of a command that was not answered is queried until it is known, and reported once', async () => {
  const sent = /** @type {any[]} */ ([]);
  const found = /** @type {any[]} */ ([]);
  const requests = new Requests((message) => Boolean(sent.push(message)), () => {}, () => null, (one) => found.push(one));
  void requests.ask('pause', {});
  void requests.ask('take_item', /** @type {any} */ ({ vehicle: 'ocelot' }));
  void requests.ask('replay', /** @type {any} */ ({ do: 'play' }));
  requests.broke();
  const [pause, take] = sent.splice(0).map(({ id }) => id);
  const now_ms = performance.now();
  requests.look(now_ms);
  requests.look(now_ms + 1000);
  assert.deepEqual(sent.map(({ ago_s, ...rest }) => (assert.ok(ago_s >= 0 && ago_s < 1), rest)), [
    { kind: 'outcome', id: `${pause}?`, of: pause }, { kind: 'outcome', id: `${take}?`, of: take, vehicle: 'ocelot' },
  ]);
  const reply = (/** @type {string} */ id, /** @type {object} */ rest) => requests.answered(/** @type {any} */ ({ kind: 'reply', id, ok: true, ...rest }));
  reply(`${pause}?`, { became: 'under_way' });
  reply(`${pause}?`, { ok: false, reason: 'The agent does not answer.' });
  assert.deepEqual(found, []);
  reply(`${pause}?`, { became: 'done' });
  reply(`${pause}?`, { became: 'done' });
  reply(take, { ok: false, reason: 'Ben has it.' }); // its own answer, late
  assert.deepEqual(found, [{ kind: 'pause', became: 'done', reason: '', cut: 'page-server' }, { kind: 'take_item', became: 'refused', reason: 'Ben has it.', cut: null }]);
  sent.length = 0;
  void requests.ask('resume', {});
  requests.broke();
  requests.look(performance.now() + 95_000);
  assert.deepEqual([sent.length, found.length], [2, 2], 'the session of the car still knows it');
  requests.look(performance.now() + 101_000);
  assert.deepEqual(found[2], { kind: 'resume', became: 'not_known', reason: '', cut: 'page-server' });
  void requests.ask('resume', {});
  requests.broke();
  requests.forget();
  sent.length = 0;
  requests.look(performance.now() + 5000);
  assert.deepEqual(sent, []);
});

test('an answer of an unknown outcome is looked up as well', async () => {
  const sent = /** @type {any[]} */ ([]);
  const requests = new Requests((message) => Boolean(sent.push(message)), () => {});
  const answer = requests.ask('pause', {});
  requests.answered(/** @type {any} */ ({ kind: 'reply', id: sent[0].id, ok: false, outcome: 'unknown', reason: 'The agent of ocelot did not answer. It may have been carried out.' }));
  assert.equal((await answer).outcome, 'unknown');
  requests.look(performance.now());
  assert.equal(sent[1].of, sent[0].id);
});

const LOST = /** @type {const} */ ([
  ['not_delivered', 'server-broker', 'The link is cut between server and broker.'],
  ['not_delivered', 'broker-agent', 'The link is cut between server and agent.'],
  ['not_delivered', 'agent-car', 'The link is cut between the server or agent and the car.'],
  ['unknown', 'server-broker', 'The link is cut between server and broker. Not known yet in which direction.'],
  ['unknown', 'broker-agent', 'The link is cut between server and agent. Not known yet in which direction.'],
]);
for (const [outcome, cut, text] of LOST) {
  test(`every command that is ${outcome} names that the link ${cut} is cut`, async () => {
    for (const kind of /** @type {const} */ (['pause', 'arm', 'release', 'take_item'])) {
      const sent = /** @type {any[]} */ ([]);
      const requests = new Requests((message) => Boolean(sent.push(message)), () => {});
      const answer = requests.ask(kind, /** @type {any} */ ({}));
      requests.answered(/** @type {any} */ ({ kind: 'reply', id: sent[0].id, ok: false, outcome, cut, reason: 'Lost.' }));
      assert.equal((await answer).reason, `Lost. ${text}`);
    }
  });
}

test('a refusal names no cut, and the later message names the direction', async () => {
  const sent = /** @type {any[]} */ ([]);
  const found = /** @type {any[]} */ ([]);
  const requests = new Requests((message) => Boolean(sent.push(message)), () => {}, () => null, (one) => found.push(one));
  const reply = requests.ask('pause', {});
  requests.answered(/** @type {any} */ ({ kind: 'reply', id: sent[0].id, ok: false, outcome: 'not_delivered', cut: null, reason: 'Too late.' }));
  assert.equal((await reply).reason, 'Too late.');
  const lost = (/** @type {string} */ became) => {
    void requests.ask('release', /** @type {any} */ ({}));
    const { id } = sent.at(-1);
    requests.answered(/** @type {any} */ ({ kind: 'reply', id, ok: false, outcome: 'unknown', cut: 'broker-agent', reason: 'Lost.' }));
    requests.answered(/** @type {any} */ ({ kind: 'reply', id: `${id}?`, ok: true, became }));
    const { kind, reason, cut } = found.at(-1);
    return laterWords(kind, became === 'done' ? 'done' : 'never', reason, cut).text;
  };
  assert.equal(lost('done'), '“Release the car” was carried out. Only its answer was lost: the link was cut in the direction back, between server and agent.');
  assert.equal(lost('never'), '“Release the car” was lost on its way. It is not carried out any more. The link was cut in the direction to the car, between server and agent.');
});

test('an answer that is merely late is shown as late, and names the part that it names itself', async (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const sent = /** @type {any[]} */ ([]);
  const texts = /** @type {string[]} */ ([]);
  const requests = new Requests((message) => Boolean(sent.push(message)), () => {}, () => null, ({ kind, became, reason, cut }) => texts.push(laterWords(kind, became, reason, cut).text));
  const late = (/** @type {object[]} */ ...replies) => {
    void requests.ask('pause', {});
    const { id } = sent.at(-1);
    t.mock.timers.tick(4000);
    for (const reply of replies) requests.answered(/** @type {any} */ ({ kind: 'reply', id, ...reply }));
    requests.answered(/** @type {any} */ ({ kind: 'reply', id: `${id}?`, ok: true, became: 'done' }));
    return texts.splice(0);
  };
  assert.deepEqual(late({ ok: true }), ['“Pause” was carried out; its answer came late.']);
  assert.deepEqual(late({ ok: false, outcome: 'not_delivered', cut: null, reason: 'Too late.' }), ['“Pause” was not carried out: Too late.']);
  assert.deepEqual(late({ ok: false, outcome: 'not_delivered', cut: 'server-broker', reason: 'Not sent.' }), ['“Pause” was not carried out: Not sent. The link is cut between server and broker.']);
  const back = '“Pause” was carried out. Only its answer was lost: the link was cut in the direction back, between ';
  assert.deepEqual(late({ ok: false, outcome: 'unknown', cut: 'broker-agent', reason: 'Lost.' }), [`${back}server and agent.`]);
  assert.deepEqual(late(), [`${back}this page and the server.`]);
});

test('what must be signed is sent once it is, in its order, and never late', async (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const sent = /** @type {any[]} */ ([]);
  let isOpen = true;
  /** @type {((message: object | null) => void)[]} */
  const done = [];
  const seal = (/** @type {{id: string}} */ message) => new Promise((resolve, reject) => { done.push((signed) => (signed ? resolve({ ...message, ...signed }) : reject(new Error('no key')))); });
  const requests = new Requests((message) => isOpen && Boolean(sent.push(message)), () => {}, /** @type {any} */ (seal));
  const first = requests.ask('pause', {});
  assert.deepEqual(sent, []);
  done[0]?.({ signed: 1 });
  await Promise.resolve();
  await Promise.resolve();
  assert.equal(sent[0].signed, 1);
  requests.answered(/** @type {any} */ ({ kind: 'reply', id: sent[0].id, ok: true }));
  assert.deepEqual(await first, { ok: true });
  const second = requests.ask('pause', {});
  t.mock.timers.tick(4000);
  assert.deepEqual(await second, { ok: false, outcome: 'not_delivered', reason: 'Not sent: this device could not sign it.' }, 'it never went out');
  done[1]?.({ signed: 2 });
  const third = requests.ask('pause', {});
  isOpen = false;
  done[2]?.({ signed: 3 });
  assert.deepEqual(await third, NOT_SENT);
  const fourth = requests.ask('pause', {});
  done[3]?.(null);
  assert.equal((await fourth).reason, 'Not sent: this device could not sign it.');
  const fifth = requests.ask('pause', {});
  requests.broke();
  assert.deepEqual(await fifth, NOT_SENT);
  assert.equal(sent.length, 1);
});

test('a scan is requested while anybody needs it, and again from a server that begins anew', () => {
  const sent = /** @type {any[]} */ ([]);
  const scans = new ScanFeed((message) => Boolean(sent.push(message)));
  scans.opened();
  scans.watch('tab', true);
  scans.watch('other', true);
  scans.watch('tab', false);
  scans.opened();
  scans.watch('other', false);
  assert.deepEqual(sent, [{ kind: 'watch', scan: true }, { kind: 'watch', scan: true }, { kind: 'watch', scan: false }]);
  assert.equal(scans.take(new ArrayBuffer(3)), false);
  assert.equal(scans.newest, null);
});

test('a page tells what it has of the log only once it may, and what came before is sent again', () => {
  const sent = /** @type {any[]} */ ([]);
  const emitted = /** @type {string[]} */ ([]);
  const emitter = new Emitter(() => assert.fail('nothing throws'));
  for (const topic of ['open', 'log', 'gap']) emitter.on(topic, () => emitted.push(topic));
  const sync = new LogSync(new EventLog(), (message) => Boolean(sent.push(message)), emitter);
  sync.greeted(/** @type {any} */ ({ kind: 'hello', boot: 'a', last_event: 2 }), { name: 'Ann' }, 0);
  assert.deepEqual([sent, emitted], [[], ['open']]);
  sync.greet();
  assert.deepEqual(sent, [{ kind: 'hello', have_event: 0, boot: 'a', name: 'Ann' }]);
  sync.greet();
  assert.equal(sent.length, 1, 'a greeting is answered once');
});

test('while a recording is shown, alarms and control are those of the live car', () => {
  const live = { alarms: [{ id: 'now' }], recording: { state: 'on' }, phase: 'lost', paused: true, control: { page: 'mine', fence: 4 } };
  const frame = state({ alarms: [{ id: 'then' }], replay: {}, live });
  assert.deepEqual(liveOf(frame)?.alarms, live.alarms);
  assert.equal(liveOf(frame)?.session.phase, 'lost');
  assert.equal(liveOf(state({ replay: {} })), null);
  assert.equal(challengeOf(state({ replay: {}, live: { challenge: 'now' }, server: { challenge: 'of the node' } })), 'now');
  assert.equal(challengeOf(state({ replay: {}, server: { challenge: 'of the node' } })), undefined);
  assert.equal(challengeOf(state({ server: { challenge: 'live' } })), 'live');
  assert.equal(fenceOf(controlOf(frame), 'mine', null), 4);
  assert.equal(fenceOf(controlOf(frame), 'other', null), null);
  assert.equal(fenceOf(controlOf(frame), 'other', 5), 5, 'an answer is ahead of the frames');
  assert.equal(fenceOf(controlOf(frame), 'other', 4), null, 'the frames have caught up');
});
