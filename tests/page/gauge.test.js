import assert from 'node:assert/strict';
import { test } from 'node:test';
import { accelerationAngle, digitsBox, faceOf, speedAngle } from '../../static/js/home/gauge-layout.js';
import { onTape, stopsWords } from '../../static/js/home/nearest.js';
import { pedalFill, steeringFill, steeringWords } from '../../static/js/home/pedals.js';

test('V_max is 180°, reversing counts by its size, beyond the end is the end', () => {
  assert.deepEqual([0, 7.5, 15, 99, -7.5].map((v) => speedAngle(v, 15)), [0, 90, 180, 180, 90]);
  assert.deepEqual([0, 3, -3, 9, -1.5].map((a) => accelerationAngle(a, 3)), [0, 90, -90, 90, -45]);
});

test('the face for 15 m/s with a limit of 11 is the drawn one', () => {
  const face = faceOf({ speed_max: 15, acceleration_max_mps2: 3, limit: 11 });
  assert.equal(face.tracks[0], 'M2.0 214.0A188 188 0 0 1 315.8 74.3M18.0 214.0A172 172 0 0 1 305.1 86.2');
  assert.equal(face.rungs.length, 7);
  assert.equal(face.rungs[0], 'M319.3 97.6L328.2 89.5');
  assert.deepEqual(face.ticks.slice(0, 2), [{ d: 'M36.0 214.0L22.0 214.0', isBig: true }, { d: 'M31.5 180.3L25.7 179.1', isBig: false }]);
  assert.deepEqual(face.labels.map(({ text, x, y }) => [text, x.toFixed(1), y.toFixed(1)]), [
    ['0', '55.0', '214.0'], ['5', '119.5', '97.9'], ['10', '260.5', '97.9'], ['15', '325.0', '214.0'], ['−3', '57.0', '188.0'], ['+3', '323.0', '188.0'],
  ]);
  assert.deepEqual([face.limit?.line, face.limit?.wedge], ['M303.8 87.7L317.8 72.1', 'M317.8 72.1L316.2 52.5L337.5 71.6Z']);
  assert.deepEqual([face.limit?.x, Math.round(face.limit?.y ?? 0), face.limit?.anchor], [378, 47, 'end']);
});

test('any scale has a readable number of ticks and its own end', () => {
  for (const max of [0.5, 1, 3, 8, 12.5, 15, 22, 40, 60, 100]) {
    const { ticks, labels } = faceOf({ speed_max: max, acceleration_max_mps2: 3, limit: null });
    assert.ok(ticks.length >= 10 && ticks.length <= 28, `${max}: ${ticks.length} ticks`);
    assert.ok(labels.length <= 9 && labels.some(({ text }) => Number(text) === max), `${max}: ${labels.map(({ text }) => text)}`);
  }
});

test('the label of the limit stays inside the picture', () => {
  for (let limit_mps = 0.5; limit_mps <= 20; limit_mps += 0.25) {
    const { limit } = faceOf({ speed_max: 15, acceleration_max_mps2: 3, limit: limit_mps });
    assert.ok(limit && limit.y >= 14 && limit.y <= 61 && limit.x >= 2 && limit.x <= 378, JSON.stringify(limit));
    if (limit.anchor === 'start') assert.ok(limit.x + 68 <= 380);
    else assert.ok(limit.x - 68 >= 0);
  }
  assert.equal(faceOf({ speed_max: 15, acceleration_max_mps2: 3, limit: null }).limit, null);
});

test('a scale in km/h or mph reads as round numbers, its odd end to one decimal', () => {
  const labels = (/** @type {number} */ max) => faceOf({ speed_max: max, acceleration_max_mps2: 3, limit: null }).labels.slice(0, -2).map(({ text }) => text);
  assert.deepEqual(labels(54), ['0', '25', '54']); // 50 would stand on the end of the acceleration
  assert.deepEqual(labels(33.554), ['0', '10', '20', '33.6']);
  for (let max = 1; max <= 216; max += 0.7) {
    const { labels } = faceOf({ speed_max: max, acceleration_max_mps2: 3, limit: null });
    for (const [i, one] of labels.entries()) {
      for (const other of labels.slice(i + 1)) {
        assert.ok(Math.abs(one.x - other.x) > 22 || Math.abs(one.y - other.y) > 14, `${max}: ${one.text} on ${other.text}`);
      }
    }
  }
});

test('the digits shrink before they leave the arc', () => {
  assert.deepEqual([digitsBox('4.2').size, digitsBox('12.6').size, digitsBox('−12.6').size], [110, 100, 80]);
  for (const digits of ['4.2', '12.6', '−12.6', '100.0']) assert.ok(digitsBox(digits).width <= 236, digits);
});

test('the tape', () => {
  assert.deepEqual([0, 20, 5, 20.1, null, -1].map((m) => onTape(m)), [26, 380, 114.5, null, null, null]);
  assert.equal(stopsWords(7.1, 3, 4.2), 'stops in 7.1 m');
  assert.equal(stopsWords(0, null, 0), 'standing');
  assert.equal(stopsWords(null, null, null), '');
});

test('pedals: 0 keeps its foot, steering is negative to the left', () => {
  assert.deepEqual(pedalFill(0), { y: 69.5, height: 2.5 });
  assert.deepEqual(pedalFill(250), { y: 0, height: 72 });
  assert.deepEqual(steeringFill(-50), { x: 43, width: 43 });
  assert.deepEqual(steeringFill(50), { x: 86, width: 43 });
  assert.deepEqual([-4, 0.3, -0.3, 2].map((p) => Object.values(steeringWords(p)).join('')), ['4% left', '0% centre', '0% centre', '2% right']);
});
