import assert from 'node:assert/strict';
import { test } from 'node:test';
import { KEYS, keyOf } from '../../static/js/shell/keys.js';
import { tabsInSight } from '../../static/js/shell/tabs.js';

/** @param {string} key @param {object} [more] */
const pressed = (key, more = {}) => ({ key, ctrlKey: false, metaKey: false, altKey: false, defaultPrevented: false, repeat: false, ...more });
const free = { isTaken: false, isOn: true };

test('each key is declared once, and none orders a slow-down', () => {
  const all = KEYS.flatMap(({ keys }) => keys);
  assert.equal(new Set(all).size, all.length);
  assert.deepEqual(KEYS.filter(({ act, does }) => /slow|order|arm/.test(`${act} ${does.replace('alarm', '')}`)), []);
});

test('a key has its declared action, in either case', () => {
  assert.equal(keyOf(pressed('a'), free)?.act, 'acknowledge');
  assert.equal(keyOf(pressed('S'), free)?.act, 'silence');
  assert.equal(keyOf(pressed('3'), free)?.act, 'tab');
  assert.equal(keyOf(pressed('?'), free)?.act, 'help');
  assert.equal(keyOf(pressed('x'), free), null);
  assert.equal(keyOf(pressed(' '), free), null, 'the replay handles it itself');
});

test('no key acts while something else has it, held down, with a modifier, or turned off', () => {
  assert.equal(keyOf(pressed('a'), { isTaken: true, isOn: true }), null);
  assert.equal(keyOf(pressed('a'), { isTaken: false, isOn: false }), null);
  for (const more of [{ ctrlKey: true }, { metaKey: true }, { altKey: true }, { repeat: true }, { defaultPrevented: true }]) {
    assert.equal(keyOf(pressed('a', more), free), null, JSON.stringify(more));
  }
});

test('the key of a shutter marks on a phone, and is the loudness of a desktop', () => {
  assert.equal(keyOf(pressed('AudioVolumeUp'), { ...free, isTouch: true })?.act, 'mark');
  assert.equal(keyOf(pressed('AudioVolumeUp'), free), null);
  assert.equal(keyOf(pressed('m'), free)?.act, 'mark');
});

test('panes are in sight together, a page alone, a drawer beside Home', () => {
  const tabs = [['home', 'pane'], ['map', 'pane'], ['scan', 'pane'], ['files', 'page'], ['settings', 'drawer']].map(([name = '', wide = '']) => ({ name, wide }));
  assert.deepEqual(tabsInSight(tabs, 0, true), ['home', 'map', 'scan']);
  assert.deepEqual(tabsInSight(tabs, 3, true), ['files']);
  assert.deepEqual(tabsInSight(tabs, 4, true), ['home', 'settings']);
  assert.deepEqual(tabsInSight(tabs, 4, true, true), ['home', 'map', 'scan', 'settings']);
  assert.deepEqual(tabsInSight(tabs, 3, true, true), ['files']);
  assert.deepEqual(tabsInSight(tabs, 1, false), ['map']);
});
