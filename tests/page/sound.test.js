import assert from 'node:assert/strict';
import { test } from 'node:test';
import { burstOf, samplesOf } from '../../static/js/alarms/sound-layout.js';

const PULSES = { high: 10, medium: 3, low: 2 };

for (const [name, count] of Object.entries(PULSES)) {
  const sound = /** @type {'high' | 'medium' | 'low'} */ (name);

  test(`${name}: ${count} pulses, found as such in its samples`, () => {
    assert.equal(burstOf(sound).pulses.length, count);
    const rate = 8000;
    const samples = samplesOf(sound, rate);
    // loudness in windows of 20 ms; a pulse is a run of loud windows
    let pulses = 0;
    let wasLoud = false;
    for (let from = 0; from + 160 <= samples.length; from += 160) {
      const isLoud = samples.subarray(from, from + 160).some((value) => Math.abs(value) > 0.08);
      if (isLoud && !wasLoud) pulses += 1;
      wasLoud = isLoud;
    }
    assert.equal(pulses, count);
    assert.ok(samples.every((value) => Math.abs(value) <= 1));
    assert.equal(samples.at(-1), 0); // a loop does not click
  });
}

test('a higher priority is louder, quicker and comes more often', () => {
  const [high, medium, low] = [burstOf('high'), burstOf('medium'), burstOf('low')];
  assert.ok(high.gain > medium.gain && medium.gain > low.gain);
  assert.ok(high.every_s < medium.every_s && medium.every_s < low.every_s);
  assert.ok((high.pulses[0]?.for_s ?? 1) < (medium.pulses[0]?.for_s ?? 0));
});

test('high is 3-2 and 3-2 again, with the rests of IEC 60601-1-8', () => {
  const { pulses } = burstOf('high');
  const rests = pulses.slice(1).map((pulse, i) => pulse.at_s - (pulses[i]?.at_s ?? 0) - (pulses[i]?.for_s ?? 0));
  for (const i of [0, 1, 3, 5, 6, 8]) assert.ok((rests[i] ?? 0) >= 0.05 && (rests[i] ?? 1) <= 0.125, `rest ${i}: ${rests[i]}`);
  for (const i of [2, 7]) assert.ok(Math.abs((rests[i] ?? 0) - (2 * 0.06 + 0.14)) < 0.01, `rest ${i}: ${rests[i]}`);
  assert.ok((rests[4] ?? 0) >= 0.35 && (rests[4] ?? 9) <= 1.3);
});
