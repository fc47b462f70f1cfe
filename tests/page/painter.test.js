import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Emitter } from '../../static/js/core/emitter.js';
import { Painter } from '../../static/js/core/painter.js';

/** A painter whose frames come when the test sets them off. @param {(error: unknown) => void} [failed] */
function studio(failed = (error) => { throw error; }) {
  /** @type {(() => void)[]} */
  const due = [];
  globalThis.requestAnimationFrame = (draw) => due.push(/** @type {() => void} */ (draw));
  const painter = new Painter(new Emitter(failed));
  return { painter, due, picture: () => due.splice(0).forEach((draw) => draw()) };
}

test('what is drawn in turn takes so long of a picture, the rest comes with the next, in the order of the requests', (context) => {
  const { painter, picture } = studio();
  let now_ms = 0;
  context.mock.method(performance, 'now', () => now_ms);
  /** @type {string[]} */
  const drawn = [];
  const [map, chart, tile] = ['map', 'chart', 'tile'].map((name) => () => {
    drawn.push(name);
    now_ms += 2.5;
  });
  for (const draw of [map, chart, tile]) painter.inTurn(/** @type {() => void} */ (draw));
  for (const expected of [['map', 'chart'], ['map', 'chart', 'tile'], ['map', 'chart', 'tile']]) {
    picture();
    assert.deepEqual(drawn, expected);
  }
  painter.inTurn(/** @type {() => void} */ (map));
  picture();
  assert.deepEqual(drawn, ['map', 'chart', 'tile', 'map'], 'it goes on after a rest');
});

test('what requests a turn in its own turn has it, and one picture is requested at a time', (context) => {
  const { painter, picture, due } = studio();
  let now_ms = 0;
  context.mock.method(performance, 'now', () => now_ms);
  /** @type {number[]} */
  const drawn = [];
  /** @type {(n: number) => () => void} */
  const line = (n) => () => {
    drawn.push(n);
    now_ms += 2.5;
    if (n < 5) painter.inTurn(line(n + 1));
  };
  painter.inTurn(line(0));
  for (const expected of [[0, 1], [0, 1, 2, 3], [0, 1, 2, 3, 4, 5]]) {
    assert.equal(due.length, 1);
    picture();
    assert.deepEqual(drawn, expected);
  }
  assert.equal(due.length, 0);
});

test('where pictures come seldom, one has all that waited for long, and no more than that', (context) => {
  const { painter, picture } = studio();
  let now_ms = 0;
  context.mock.method(performance, 'now', () => now_ms);
  /** @type {string[]} */
  const drawn = [];
  /** @type {(name: string) => () => void} */
  const pane = (name) => () => {
    drawn.push(name);
    now_ms += 5;
    if (name === 'tile') painter.inTurn(pane('late'));
  };
  for (const name of ['map', 'chart', 'brake', 'tile']) painter.inTurn(pane(name));
  now_ms = 150;
  picture();
  assert.deepEqual(drawn, ['map'], 'a piece of each picture while they come soon');
  now_ms = 320;
  picture();
  assert.deepEqual(drawn, ['map', 'chart', 'brake', 'tile']);
  picture();
  assert.deepEqual(drawn, ['map', 'chart', 'brake', 'tile', 'late']);
});

test('a second request before its turn waits once', () => {
  const { painter, picture } = studio();
  let times = 0;
  const draw = () => void (times += 1);
  for (let i = 0; i < 10; i += 1) painter.inTurn(draw);
  for (let i = 0; i < 3; i += 1) picture();
  assert.equal(times, 1);
});

test('what throws in its turn is reported, and the next has its turn', () => {
  /** @type {unknown[]} */
  const errors = [];
  const { painter, picture } = studio((error) => errors.push(error));
  let isDrawn = false;
  painter.inTurn(() => { throw new Error('no canvas'); });
  painter.inTurn(() => { isDrawn = true; });
  picture();
  picture();
  assert.equal(`${errors}`, 'Error: no canvas');
  assert.equal(isDrawn, true);
});

test('a picture that never came holds up nothing once the failure was noticed', () => {
  const { painter, picture } = studio();
  const { requestAnimationFrame } = globalThis;
  globalThis.requestAnimationFrame = () => 0;
  let times = 0;
  const draw = () => void (times += 1);
  painter.inTurn(draw);
  const complain = console.error;
  console.error = () => {};
  for (let i = 0; i < 7; i += 1) painter.look(true);
  console.error = complain;
  globalThis.requestAnimationFrame = requestAnimationFrame;
  painter.inTurn(draw);
  picture();
  assert.equal(times, 1);
});

test('a page that has just begun waits a moment for its first frame before it draws without one', (context) => {
  let now_ms = 1000;
  context.mock.method(performance, 'now', () => now_ms);
  const { painter, due, picture } = studio();
  let drawn = 0;
  painter.draw = () => { drawn += 1; };
  for (now_ms of [1200, 1350]) {
    painter.keepUp(now_ms, -Infinity);
    assert.equal(due.length, 0);
  }
  now_ms = 1400;
  painter.keepUp(now_ms, -Infinity);
  picture();
  assert.equal(drawn, 1, 'no frame came');
});

test('the first frame of a page that has just begun is drawn at once', () => {
  const { painter, due } = studio();
  let drawn = 0;
  painter.draw = () => { drawn += 1; };
  const frame = { session: { phase: 'live', paused: false }, link: { cut: null }, alarms: [], decelerate: { state: 'off', order: null, countdown: null } };
  painter.frame(/** @type {any} */ (frame), performance.now(), true);
  assert.equal(drawn, 1);
  assert.equal(due.length, 0);
});
