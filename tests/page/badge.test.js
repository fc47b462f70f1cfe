import assert from 'node:assert/strict';
import { test } from 'node:test';
import { badgeOf } from '../../static/js/shell/badge.js';
import { alarm, state } from './frames.js';

const seen = { isSilent: false, isMonitoring: true, state: 'Live' };
const warning = (more = {}) => alarm({ id: 'gps', title: 'GPS drift', priority: 'warning', ...more });

test('the title names the worst alarm and counts what is urgent', () => {
  assert.deepEqual(badgeOf(state(), seen), { title: 'catgraph', icon: 'plain', count: 0 });
  const both = badgeOf(state({ alarms: [warning(), alarm({ title: 'Speed above limit' }), alarm({ id: 'x', priority: 'advisory' })] }), seen);
  assert.deepEqual(both, { title: '(2) Speed above limit · catgraph', icon: 'critical', count: 2 });
  assert.equal(badgeOf(state({ alarms: [warning({ state: 'ACKED' })] }), seen).icon, 'warning');
  assert.equal(badgeOf(state({ alarms: [warning({ state: 'SHELVED' })] }), seen).count, 0);
});

test('what is not live is never called by its last alarm', () => {
  const frame = state({ alarms: [alarm()] });
  assert.deepEqual(badgeOf(frame, { ...seen, isSilent: true }), { title: 'Not live · catgraph', icon: 'lost', count: null });
  assert.equal(badgeOf(frame, { ...seen, state: 'Lost' }).title, 'Connection lost · catgraph');
  assert.equal(badgeOf(frame, { ...seen, isMonitoring: false }).title, 'catgraph');
  assert.equal(badgeOf(null, seen).title, 'catgraph');
  assert.match(badgeOf(state({ session: { paused: true } }), seen).title, /^Paused/);
});
