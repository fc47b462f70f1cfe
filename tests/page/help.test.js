import assert from 'node:assert/strict';
import { test } from 'node:test';
import { helpWords } from '../../static/js/home/help.js';
import { state } from './frames.js';

const signals = (...freshness) => Object.fromEntries(freshness.map((one, i) => [`s${i}`, { freshness: one }]));
const helped = (...freshness) => helpWords(/** @type {any} */ (state({ signals: signals(...freshness), link: { topics_subscribed: 3 } })));

test('Home shows what would fill it while nothing has arrived, and nothing once a value was there', () => {
  assert.match(helped('not_published', 'not_published'), /Open Settings and choose a topic/);
  assert.match(helped('not_published', 'never'), /first messages of the 3 topics/);
  assert.equal(helped('never', 'fresh'), '');
  assert.equal(helped('never', 'stale'), '', 'a value that grew old is shown as old');
});

test('where the car sends nothing, Home does not call its topics unknown', () => {
  const frame = /** @type {any} */ (state({ signals: signals('not_published'), link: { cut: 'bridge-car' } }));
  assert.equal(helpWords(frame), '');
});

test('where no car is monitored, Home is not shown and has no text', () => {
  const frame = /** @type {any} */ (state({ signals: signals('not_published'), session: { phase: 'lost' } }));
  assert.equal(helpWords(frame), '');
});
