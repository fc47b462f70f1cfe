import assert from 'node:assert/strict';
import { test } from 'node:test';
import { chainOf } from '../../static/js/core/link.js';
import { state } from './frames.js';

const now = { isSilent: false, silence_s: 0.1, lag_s: 0.1, heard_ms: 0 };

test('live: every node answers, and the age is the car’s at the glass', () => {
  const chain = chainOf({ ...now, frame: state() });
  assert.deepEqual([chain.state, chain.cut, chain.age_s?.toFixed(2)], ['Live', null, '0.15']);
  assert.ok(chain.nodes.every((node) => node.isKnown && !node.isBad));
});

test('a weak radio is shown, whether it is live or not', () => {
  const trip = { mean_ms: 900, spread_ms: 100 };
  const live = chainOf({ ...now, frame: state(), trip });
  assert.deepEqual([live.state, live.isWeak, live.detail], ['Live', true, 'Weak radio: an answer takes 0.9 s.']);
  const lost = chainOf({ ...now, frame: state(), isSilent: true, silence_s: 3.4, trip });
  assert.match(lost.detail, /keeps trying\. Weak radio: an answer takes 0\.9 s\.$/);
  assert.equal(chainOf({ ...now, frame: state(), trip: { mean_ms: 160, spread_ms: 20 } }).isWeak, undefined);
});

test('each silence is assigned to the part that fell silent', () => {
  const server = chainOf({ ...now, frame: state(), isSilent: true, silence_s: 3.4 });
  assert.deepEqual([server.state, server.cut, server.sentence, server.nodes[1]?.mark], ['Lost', 0, 'The server fell silent.', 'silent 3.4 s']);
  assert.deepEqual(server.nodes.map((node) => node.isKnown), [true, false, false, false]);

  const bridge = chainOf({ ...now, frame: state({ session: { phase: 'lost' }, link: { cut: 'server-bridge', bridge_age_s: 6.1 } }) });
  assert.deepEqual([bridge.state, bridge.cut, bridge.sentence, bridge.nodes[2]?.mark], ['Lost', 1, 'The bridge stopped answering.', 'silent 6.2 s']);

  const car = chainOf({ ...now, frame: state({ link: { cut: 'bridge-car', car_age_s: 3.3, since_ms: 5 } }) });
  assert.deepEqual([car.state, car.cut, car.sentence, car.nodes[3]?.mark, car.since_ms], ['Silent', 2, 'The car fell silent.', 'silent 3.4 s', 5]);
});

test('a server that answers and has nothing of the car accuses what is between', () => {
  const lost = chainOf({ ...now, frame: state(), isSilent: true, silence_s: 3.4, unserved: 'The agent of car does not answer.' });
  assert.deepEqual([lost.state, lost.cut, lost.sentence, lost.isUnserved], ['Lost', 1, 'The agent of car does not answer.', true]);
  assert.deepEqual(lost.nodes.map(({ name, mark, isBad }) => [name, mark, isBad]), [['This device', 'here', false], ['Server', 'answers', false], ['Agent', 'silent 3.4 s', true], ['Car', 'unknown', false]]);
  const never = chainOf({ ...now, frame: null, isSilent: true, heard_ms: null, unserved: 'Nothing came from it.' });
  assert.deepEqual([never.age_s, never.nodes[2]?.mark, never.detail], [null, 'no answer', 'The server answers.']);
  assert.equal(chainOf({ ...now, frame: state(), unserved: 'Nothing came from it.' }).state, 'Live', 'what came since is newer');
});

test('the text of the server’s problem is used where it has any', () => {
  const problem = { code: 'refused', title: 'Nothing listens.', hint: 'Start it.', mark: 'refused' };
  const chain = chainOf({ ...now, frame: state({ session: { phase: 'failed' }, link: { cut: 'server-bridge', problem } }) });
  assert.deepEqual([chain.cut, chain.sentence, chain.detail, chain.nodes[2]?.mark], [1, 'Nothing listens.', 'Start it.', 'refused']);
});

test('a car that never spoke is awaited for a while, then silent', () => {
  const fresh = (/** @type {number} */ connected_for_s) => chainOf({ ...now, frame: state({ session: { connected_for_s }, link: { car_age_s: null, topics_heard: 0 } }) });
  assert.equal(fresh(1).state, 'Waiting');
  assert.deepEqual([fresh(1).known, fresh(1).nodes.map((node) => node.isKnown)], [2, [true, true, true, false]], 'nothing has come from the car');
  assert.deepEqual([fresh(5).state, fresh(5).cut, fresh(5).nodes[3]?.mark], ['Silent', 2, 'silent 5.1 s']);
});

test('before the first frame the server does not answer; after a sleep nobody is accused', () => {
  assert.equal(chainOf({ ...now, frame: null, isSilent: true, heard_ms: null }).sentence, 'The server does not answer.');
  assert.deepEqual([chainOf({ ...now, frame: state(), isSilent: true, silence_s: 0.3 })].map(({ state, cut }) => [state, cut]), [['Waking', null]]);
  const waking = chainOf({ ...now, frame: state(), isSilent: true, silence_s: 0.3 });
  assert.deepEqual([waking.known, waking.nodes.map(({ mark, isKnown, isBad }) => [mark, isKnown, isBad])], [0, [['here', true, false], ['', false, false], ['', false, false], ['', false, false]]], 'nothing has come since');
});
