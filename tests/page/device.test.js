import assert from 'node:assert/strict';
import { test } from 'node:test';
import { deviceName, kindOf } from '../../static/js/control/device-name.js';

const AGENTS = /** @type {const} */ ([
  ['Mozilla/5.0 (Linux; Android 14; Pixel 7) AppleWebKit/537.36 (KHTML, like Gecko) Chrome/125.0.0.0 Mobile Safari/537.36', 'Pixel 7'],
  ['Mozilla/5.0 (Linux; Android 9; SM-G960F Build/PPR1.180610.011; wv) AppleWebKit/537.36', 'SM-G960F'],
  ['Mozilla/5.0 (Linux; Android 10; K) AppleWebKit/537.36 (KHTML, like Gecko) Chrome/125.0.0.0 Mobile Safari/537.36', 'Android phone'],
  ['Mozilla/5.0 (Android 14; Mobile; rv:126.0) Gecko/126.0 Firefox/126.0', 'Mobile'],
  ['Mozilla/5.0 (iPhone; CPU iPhone OS 17_5 like Mac OS X) AppleWebKit/605.1.15', 'iPhone'],
  ['Mozilla/5.0 (iPad; CPU OS 17_5 like Mac OS X)', 'iPad'],
  ['Mozilla/5.0 (Macintosh; Intel Mac OS X 10_15_7)', 'Mac'],
  ['Mozilla/5.0 (Windows NT 10.0; Win64; x64)', 'Windows PC'],
  ['Mozilla/5.0 (X11; CrOS x86_64 14541.0.0)', 'Chromebook'],
  ['Mozilla/5.0 (X11; Linux x86_64)', 'Linux PC'],
  ['', 'Browser'],
]);

test('the kind of device is known by its user agent', () => {
  for (const [agent, kind] of AGENTS) assert.equal(kindOf(agent), kind === 'Mobile' ? 'Android phone' : kind);
});

function storage(/** @type {Record<string, string>} */ kept = {}) {
  return { kept, getItem: (/** @type {string} */ key) => kept[key] ?? null, setItem: (/** @type {string} */ key, /** @type {string} */ value) => void (kept[key] = value) };
}

test('a name is made once and stays', () => {
  const place = storage();
  let n = 0;
  const name = deviceName('iPhone', place, () => n++);
  assert.equal(name, 'iPhone · abcd');
  assert.equal(deviceName('iPhone', place), name);
});

test('two phones of one kind have two names', () => {
  assert.notEqual(deviceName('iPhone', storage(), () => 0), deviceName('iPhone', storage(), () => 1));
});

test('without storage, or with one that refuses, there is a name all the same', () => {
  const refuses = { getItem() { throw new Error('no'); }, setItem() { throw new Error('no'); } };
  for (const place of [null, refuses]) assert.match(deviceName('iPad', place), /^iPad · [a-z2-9]{4}$/);
});

test('a name kept by hand is bounded', () => {
  assert.equal(deviceName('', storage({ 'catgraph.device': 'x'.repeat(400) })).length, 40);
});
