import assert from 'node:assert/strict';
import { test } from 'node:test';
import { FAR_ENOUGH, HOLD_MS, KNOB_PX, Slide } from '../../static/js/slowdown/slide-layout.js';

const WAY = 140;

/** A thumb on the knob that goes so far of the way and is let go. @param {number} share @param {(slide: Slide) => void} [meanwhile] */
function drag(share, meanwhile = () => {}) {
  const slide = new Slide();
  slide.down(1, 30, WAY);
  slide.move(1, 30 + (share * WAY) / 2);
  meanwhile(slide);
  slide.move(1, 30 + share * WAY);
  const at = slide.share;
  return { outcome: slide.up(1), at, slide };
}

for (const [share, outcome] of /** @type {const} */ ([[0, 'tap'], [0.05, 'tap'], [0.3, 'short'], [0.79, 'short'], [0.81, 'order'], [1, 'order'], [9, 'order'], [-3, 'tap']])) {
  test(`slid ${share} of the way: ${outcome}`, () => {
    const { outcome: found, slide } = drag(share);
    assert.equal(found, outcome);
    assert.equal(slide.share, 0, 'it springs back, or the order’s own frame fills it');
    assert.equal(slide.phase, 'rest');
  });
}

test('beyond its end the knob stays at its end; back before it is let go, it is no order', () => {
  assert.equal(drag(9).at, 1);
  const slide = new Slide();
  slide.down(1, 10, WAY);
  slide.move(1, 10 + WAY);
  slide.move(1, 10 + 0.4 * WAY);
  assert.equal(slide.up(1), 'short');
});

test('it is an order only once it is let go', () => {
  const slide = new Slide();
  slide.down(1, 10, WAY);
  slide.move(1, 10 + WAY);
  assert.ok(slide.share >= FAR_ENOUGH);
  assert.equal(slide.phase, 'drag');
  slide.rest(); // the browser takes the gesture away
  assert.equal(slide.up(1), null);
});

test('a pocket: a second finger anywhere, before or during, and nothing counts until all of it is over', () => {
  const { outcome, slide } = drag(1, (one) => one.bar());
  assert.equal(outcome, 'tap', 'barred: nothing was ordered');
  assert.equal(drag(1, (one) => one.down(2, 40, WAY)).outcome, 'tap');
  slide.down(1, 10, WAY);
  slide.move(1, 10 + WAY);
  assert.equal(slide.up(1), 'order', 'the next touch is another one');
});

test('another pointer moves nothing and ends nothing', () => {
  const slide = new Slide();
  slide.down(1, 10, WAY);
  slide.move(2, 10 + WAY);
  assert.equal(slide.share, 0);
  assert.equal(slide.up(2), null);
  assert.equal(slide.phase, 'drag');
});

for (const [at, begins] of /** @type {const} */ ([[-20, false], [-10, true], [0, true], [KNOB_PX, true], [KNOB_PX + 15, true], [KNOB_PX + 30, false], [180, false]])) {
  test(`a touch ${at} px from the resting end ${begins ? 'begins' : 'begins nothing'}`, () => {
    const slide = new Slide();
    slide.down(1, at, WAY);
    slide.move(1, at + WAY);
    assert.equal(slide.up(1) === 'order', begins);
  });
}

test('from the keyboard: Enter or space held for a second, once', () => {
  for (const key of ['Enter', ' ']) {
    const slide = new Slide();
    slide.press(key, false, 1000);
    slide.press(key, true, 1500); // the keyboard repeats it
    assert.equal(slide.look(1000 + HOLD_MS - 1), null);
    assert.ok(slide.share > 0.99);
    assert.equal(slide.look(1000 + HOLD_MS), 'order');
    assert.equal(slide.look(1000 + 3 * HOLD_MS), null, 'held on, it is not ordered again');
    slide.press(key, true, 5000);
    assert.equal(slide.look(9000), null);
    assert.equal(slide.release(), null);
  }
});

test('from the keyboard: too short, another key, or a finger meanwhile is no order', () => {
  const slide = new Slide();
  slide.press('Enter', false, 0);
  slide.look(600);
  assert.equal(slide.release(), 'short');
  slide.press('Enter', false, 1000);
  slide.press('a', false, 1200);
  assert.equal(slide.look(3000), null);
  slide.release();
  slide.press('x', false, 4000);
  assert.equal(slide.look(9000), null);
  slide.press('Enter', false, 9000);
  slide.down(1, 10, WAY);
  assert.equal(slide.look(19_000), null);
});

test('a way of no length orders nothing by itself', () => {
  const slide = new Slide();
  slide.down(1, 10, 0);
  assert.equal(slide.up(1), 'tap');
});
