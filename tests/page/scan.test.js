import assert from 'node:assert/strict';
import { test } from 'node:test';
import { INVALID, NO_RETURN, NOTHING_IN_RANGE, TOO_CLOSE, readScan } from '../../static/js/scan-frame.js';
import { beamWords, namedSectors, nearestInCorridor, plotScale, pointsOf, ringsOf, sectorsOf } from '../../static/js/scan-layout.js';

/**
 * @param {number[]} codes
 * @param {Partial<import('../../static/js/scan-frame.js').Scan>} [more]
 */
const scan = (codes, more = {}) => ({ number: 1, age_s: 0, angle_min_rad: -Math.PI / 2, angle_increment_rad: Math.PI / 180, range_max_m: 81, scale_m: 0.01, codes: Uint16Array.from(codes), ...more });

/** @param {number[]} codes */
function frame(codes, { magic = 0x53, version = 1, increment = Math.PI / 180, scale = 0.01, beams = codes.length } = {}) {
  const bytes = new ArrayBuffer(28 + 2 * codes.length);
  const view = new DataView(bytes);
  view.setUint8(0, magic);
  view.setUint8(1, version);
  view.setUint16(2, beams, true);
  view.setUint32(4, 4_000_000_000, true);
  [0.01, -Math.PI / 2, increment, 81, scale].forEach((value, i) => view.setFloat32(8 + 4 * i, value, true));
  codes.forEach((code, i) => view.setUint16(28 + 2 * i, code, true));
  return bytes;
}

test('a frame is read as it is written', () => {
  const read = readScan(frame([0, 65535, 1234]));
  assert.deepEqual([read?.number, read?.range_max_m, [...(read?.codes ?? [])]], [4_000_000_000, 81, [0, 65535, 1234]]);
});

test('what is no scan is refused', () => {
  for (const bytes of [new ArrayBuffer(0), new ArrayBuffer(27), frame([1], { magic: 1 }), frame([1], { version: 2 }), frame([1], { beams: 2 }), frame([1], { scale: NaN }), frame([1], { increment: Infinity })]) {
    assert.equal(readScan(bytes), null);
  }
  assert.notEqual(readScan(frame([])), null);
});

test('only beams with a range are drawn: nothing below range_min, nothing beyond', () => {
  const points = pointsOf(scan([TOO_CLOSE, NO_RETURN, INVALID, NOTHING_IN_RANGE, 500, 5000], { angle_min_rad: 0, angle_increment_rad: 0 }), 20);
  assert.deepEqual([...points], [5, 0]);
});

test('a beam stands at angle_min + i·increment, also where the increment is negative', () => {
  const [x, y] = pointsOf(scan([0, 1000], { angle_min_rad: Math.PI / 2, angle_increment_rad: -Math.PI / 2 }), 20);
  assert.ok(Math.abs((x ?? 0) - 10) < 1e-5 && Math.abs(y ?? 1) < 1e-5);
});

test('the nearest in the corridor, not the nearest of all', () => {
  const codes = Array(181).fill(NOTHING_IN_RANGE);
  codes[0] = 300; // right beside the car
  codes[90] = 1300;
  codes[88] = 1240;
  codes[80] = 900; // ahead, but 1.56 m to the right
  const nearest = nearestInCorridor(scan(codes));
  assert.ok(Math.abs((nearest?.range_m ?? 0) - 12.4) < 1e-9 && Math.abs((nearest?.bearing_rad ?? 0) + 0.0349) < 1e-3);
  assert.equal(nearestInCorridor(scan(Array(181).fill(NO_RETURN))), null);
  assert.equal(nearestInCorridor(scan([500], { angle_min_rad: Math.PI, angle_increment_rad: 0 })), null); // behind
});

test('neighbours that tell nothing make a sector by what they say; nothing in range is told, not hatched', () => {
  const sectors = sectorsOf(scan([100, 0, 0, TOO_CLOSE, NOTHING_IN_RANGE, INVALID]));
  assert.deepEqual(sectors.map(({ code, beams }) => [code, beams]), [[NO_RETURN, 2], [TOO_CLOSE, 1], [INVALID, 1]]);
  const wide = sectors[0];
  assert.ok(wide && Math.abs(wide.to_rad - wide.from_rad - (2 * Math.PI) / 180) < 1e-9);
  const mirrored = sectorsOf(scan([0, 0, 0], { angle_increment_rad: -Math.PI / 180 }))[0];
  assert.ok(mirrored && mirrored.from_rad < mirrored.to_rad);
  assert.equal(namedSectors(sectors, 4).length, 0);
  assert.equal(namedSectors(sectorsOf(scan(Array(17).fill(0))), 4).length, 1);
});

test('the count of beams', () => {
  assert.equal(beamWords(scan([...Array(164).fill(500), ...Array(17).fill(0)])), '164 of 181 beams usable · 17 hatched: no return');
  assert.equal(beamWords(scan([500, 0, TOO_CLOSE, NOTHING_IN_RANGE])), '1 of 4 usable · 1 beyond range · hatched: 1 no return, 1 too close');
  assert.equal(beamWords(scan([500])), '1 of 1 beams usable');
});

test('the car stands at the foot, ahead is up, left is left', () => {
  const { at, cx, cy } = plotScale(412, 470, 20);
  assert.deepEqual(at(0, 0), [cx, cy]);
  assert.deepEqual(at(20, 0).map(Math.round), [206, 14]);
  assert.ok(at(0, 1)[0] < cx);
  assert.deepEqual(ringsOf(20), [5, 10, 15, 20]);
});
