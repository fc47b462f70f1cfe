import assert from 'node:assert/strict';
import { test } from 'node:test';
import { DeadMan } from '../../static/js/core/dead-man.js';

test('two seconds without a frame cover, and three fresh frames lift', () => {
  const man = new DeadMan();
  man.look(10_000);
  assert.equal(man.covered, false); // nothing was ever shown
  man.frame(10_000, 0);
  man.look(12_000);
  assert.equal(man.covered, false);
  man.look(12_001);
  assert.equal(man.covered, true);
  assert.deepEqual([12_100, 12_200, 12_300].map((at) => (man.frame(at, 0), man.covered)), [true, true, false]);
});

test('an old frame is a memory: it neither counts nor rewinds', () => {
  const man = new DeadMan();
  man.frame(0, 0);
  assert.equal(man.frame(1000, 2001), false);
  man.look(2001);
  assert.equal(man.covered, true);
  man.frame(2100, 0);
  man.frame(2200, 0);
  man.frame(2300, 5000); // a straggler begins the count anew
  assert.equal((man.frame(2400, 0), man.covered), true);
});

test('a page that was away is covered, whatever the clocks say', () => {
  const man = new DeadMan();
  man.frame(0, 0);
  man.cover();
  assert.equal(man.covered, true);
  assert.equal((man.frame(100, 0), man.frame(200, 0), man.covered), true);
  assert.equal((man.frame(300, 0), man.covered), false);
});

test('a late look and the frame after it do not hide the gap', () => {
  const man = new DeadMan();
  man.frame(0, 0);
  man.frame(5000, 0); // the script hung: no look between
  assert.equal(man.covered, true);
});
