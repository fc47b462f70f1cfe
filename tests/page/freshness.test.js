import assert from 'node:assert/strict';
import { test } from 'node:test';
import { freshnessStyle } from '../../static/js/core/freshness.js';

/** @returns {any} */
const signal = (more = {}) => ({ freshness: 'fresh', age_s: 0.02, horizon_s: 1, period_s: 0.0133, ...more });

test('the age at the glass is the server’s and the page’s silence', () => {
  assert.deepEqual(freshnessStyle(signal(), 0.1), { ink: 'fresh', age_s: 0.12000000000000001 });
});

test('the rhythm of frames ages nothing, missing frames do', () => {
  assert.equal(freshnessStyle(signal(), 0.25).ink, 'fresh');
  assert.equal(freshnessStyle(signal(), 0.61).ink, 'ageing');
  assert.equal(freshnessStyle(signal(), 1.5).ink, 'stale');
  assert.equal(freshnessStyle(signal({ horizon_s: 10 }), 1.5).ink, 'ageing');
});

test('the page never believes more than the server does', () => {
  assert.equal(freshnessStyle(signal({ freshness: 'stale', age_s: 4 }), 0).ink, 'stale');
  assert.equal(freshnessStyle(signal({ freshness: 'ageing' }), 0).ink, 'ageing');
});

test('what never came stays what it is', () => {
  assert.equal(freshnessStyle(signal({ freshness: 'never', age_s: null }), 9).ink, 'never');
  assert.equal(freshnessStyle(signal({ freshness: 'not_published', age_s: null }), 9).ink, 'not_published');
  assert.equal(freshnessStyle(signal({ freshness: 'not_measured', age_s: null }), 9).ink, 'not_measured');
  assert.deepEqual(freshnessStyle(undefined, 0), { ink: 'not_published', age_s: null });
});
