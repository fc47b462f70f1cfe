import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Emitter } from '../../static/js/core/emitter.js';
import { EventLog } from '../../static/js/core/event-log.js';
import { controlOf, fenceOf, liveOf } from '../../static/js/core/live-car.js';
import { LogSync } from '../../static/js/core/log-sync.js';
import { Requests } from '../../static/js/core/requests.js';
import { ScanFeed } from '../../static/js/core/scan-feed.js';
import { state } from './frames.js';

test('a listener that throws is a failure, and stops none of the others', () => {
  /** @type {unknown[]} */
  const failed = [];
  const heard = /** @type {string[]} */ ([]);
  const emitter = new Emitter((error) => failed.push(error));
  emitter.on('draw', () => { throw new Error('a broken panel'); });
  const off = emitter.on('draw', (detail) => heard.push(detail));
  emitter.emit('draw', 'one');
  off();
  emitter.emit('draw', 'two');
  assert.deepEqual([heard, failed.length], [['one'], 2]);
});

test('what is asked is answered once, refused where it cannot be sent, and refused when the connection breaks', async (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const sent = /** @type {any[]} */ ([]);
  const refused = /** @type {(string | undefined)[]} */ ([]);
  let isOpen = false;
  const requests = new Requests((message) => isOpen && Boolean(sent.push(message)), ({ reason }) => refused.push(reason));
  assert.deepEqual(await requests.ask('pause', {}), { ok: false, reason: 'Not sent: the server does not answer.' });
  isOpen = true;
  const first = requests.ask('pause', { fence: 7 });
  assert.deepEqual(sent[0], { kind: 'pause', id: 'p2', fence: 7 });
  requests.answered(/** @type {any} */ ({ kind: 'reply', id: 'p2', ok: false, reason: 'Not now.', held_by: 'Ann', conflict: true }));
  assert.deepEqual(await first, { ok: false, reason: 'Not now.', isConflict: true, heldBy: 'Ann' });
  const second = requests.ask('pause', {});
  requests.broke();
  assert.equal((await second).reason, 'The connection to the server broke.');
  const third = requests.ask('pause', {}, 100);
  t.mock.timers.tick(100);
  assert.equal((await third).reason, 'The server did not answer in time.');
  assert.deepEqual(refused, ['Not now.', 'The connection to the server broke.', 'The server did not answer in time.']);
});

test('a scan is asked for while anybody wants it, and again of a server that begins anew', () => {
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
  assert.equal(fenceOf(controlOf(frame), 'mine', null), 4);
  assert.equal(fenceOf(controlOf(frame), 'other', null), null);
  assert.equal(fenceOf(controlOf(frame), 'other', 5), 5, 'an answer is ahead of the frames');
  assert.equal(fenceOf(controlOf(frame), 'other', 4), null, 'the frames have caught up');
});
