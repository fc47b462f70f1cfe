import assert from 'node:assert/strict';
import { test } from 'node:test';
import { INVALID, NO_RETURN, NOTHING_IN_RANGE, TOO_CLOSE, readScan } from '../../static/js/scan/scan-frame.js';
import { NOT_IN_VIEW, beamWords, behind, clearOf, clearPlace, coversAny, isInView, liesOverSector, namedSectors, pinched, placeOf, plotScale, pointsOf, reachWithin, ringWords, ringsOf, sectorSentences, sectorsOf, unseenOf, zoomed } from '../../static/js/scan/scan-layout.js';
import { edgesOf, endOf } from '../../static/js/scan/scan-corridor.js';
import { beside, follow, nearestShown, nearestTo } from '../../static/js/scan/scan-pick.js';
import { ScanMark } from '../../static/js/scan/scan-mark.js';

const DEGREE = Math.PI / 180;
const NOTHING_JUDGED = { tyre_angle_rad: 0, wider_m: 0, gap_m: null, beam: null, isBlind: false, stopping_m: null };

/**
 * @param {ArrayLike<number>} codes
 * @param {Partial<import('../../static/js/scan/scan-frame.js').Scan>} [more]
 */
const scan = (codes, more = {}) => ({ number: 1, age_s: 0, angle_min_rad: -Math.PI / 2, angle_increment_rad: DEGREE, range_max_m: 81, scale_m: 0.01, judged: NOTHING_JUDGED, codes: Uint16Array.from(codes), ...more });

/** @param {number} actual @param {number} wanted */
const near = (actual, wanted, within = 1e-6) => assert.ok(Math.abs(actual - wanted) <= within, `${actual} is not ${wanted}`);

/** @param {number[]} codes */
function frame(codes, { magic = 0x53, version = 2, increment = DEGREE, range_max = 650, gap = 12.4, beam = 1, tyre = -10, stopping = 714, beams = codes.length } = {}) {
  const bytes = new ArrayBuffer(32 + 2 * codes.length);
  const view = new DataView(bytes);
  view.setUint8(0, magic);
  view.setUint8(1, version);
  view.setUint16(2, beams, true);
  view.setUint32(4, 4_000_000_000, true);
  view.setUint16(8, 10, true);
  view.setUint16(10, stopping, true);
  [-Math.PI / 2, increment, range_max, gap].forEach((value, i) => view.setFloat32(12 + 4 * i, value, true));
  view.setInt8(28, tyre);
  view.setUint8(29, 20);
  view.setUint16(30, beam, true);
  codes.forEach((code, i) => view.setUint16(32 + 2 * i, code, true));
  return bytes;
}

test('a frame is read as it is written', () => {
  const read = readScan(frame([0, 65535, 1234]));
  assert.deepEqual([read?.number, read?.age_s, read?.range_max_m, read?.scale_m, [...(read?.codes ?? [])]], [4_000_000_000, 0.01, 650, 0.01, [0, 65535, 1234]]);
  assert.deepEqual({ ...read?.judged, gap_m: Math.fround(12.4) }, { tyre_angle_rad: -0.05, wider_m: 0.2, gap_m: Math.fround(12.4), beam: 1, isBlind: false, stopping_m: 7.14 });
});

test('a laser behind the nose and aside: its returns are drawn from the nose', () => {
  const roof = scan([1000], { angle_min_rad: 4 * Math.PI, x_m: -2.2, y_m: 0.4 }); // counted from two turns on: straight ahead
  assert.deepEqual([...pointsOf(roof, 20)], [7.8, 0.4].map(Math.fround));
  const found = nearestTo(roof, 7.8, 0.4, 0.1);
  near(found?.bearing_rad ?? NaN, 0);
  near(found?.range_m ?? NaN, 10);
  assert.equal(behind(scan([200, 100], { angle_min_rad: 0, x_m: -2.2 })), 1, 'on the bonnet');
});

test('a full circle has no seam: what is hatched on both sides of it is one sector, ahead', () => {
  const codes = Array.from({ length: 360 }, (_, i) => (i < 10 || i >= 350 ? NO_RETURN : 500));
  for (const angle_increment_rad of [DEGREE, -DEGREE]) {
    const [only, ...more] = sectorsOf(scan(codes, { angle_min_rad: 0, angle_increment_rad }));
    assert.deepEqual(more, []);
    assert.equal(only?.beams, 20);
    near((only?.from_rad ?? NaN) + (only?.to_rad ?? NaN), -Math.sign(angle_increment_rad) * DEGREE, 1e-9);
    near((only?.to_rad ?? NaN) - (only?.from_rad ?? NaN), 20 * DEGREE, 1e-9);
  }
  assert.equal(sectorsOf(scan(codes.slice(0, 270).concat(Array(10).fill(NO_RETURN)))).length, 2, 'no full circle');
});

test('bearings count from minus half a turn, wherever the laser begins', () => {
  const right = scan([NO_RETURN, 500], { angle_min_rad: 1.75 * Math.PI, angle_increment_rad: DEGREE });
  near(nearestShown(right, 20)?.bearing_rad ?? NaN, -Math.PI / 4 + DEGREE, 1e-9);
});

test('nothing in the corridor, a corridor not seen and a speed not known are three things', () => {
  assert.deepEqual(readScan(frame([1, 2], { gap: 0, beam: 65535 }))?.judged, { tyre_angle_rad: -0.05, wider_m: 0.2, gap_m: null, beam: null, isBlind: false, stopping_m: 7.14 });
  assert.deepEqual(readScan(frame([1, 2], { gap: 0, beam: 65534, stopping: 65535 }))?.judged, { tyre_angle_rad: -0.05, wider_m: 0.2, gap_m: null, beam: null, isBlind: true, stopping_m: null });
  assert.equal(readScan(frame([1, 2], { beam: 2 }))?.judged.beam, null); // a beam there is not
});

test('what is no scan is refused', () => {
  for (const bytes of [new ArrayBuffer(0), new ArrayBuffer(31), frame([1], { magic: 1 }), frame([1], { version: 1 }), frame([1], { beams: 2 }), frame([1], { range_max: NaN }), frame([1], { gap: Infinity }), frame([1], { increment: Infinity })]) {
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

test('neighbours without a usable range make a sector by their code; nothing in range is a reading, not hatched', () => {
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
  const scale = plotScale(412, 470, 20);
  const { at, cx, cy } = scale;
  assert.deepEqual(at(0, 0), [cx, cy]);
  assert.deepEqual(at(20, 0).map(Math.round), [206, 14]);
  assert.ok(at(0, 1)[0] < cx);
  const { x_m, y_m } = placeOf(scale, ...at(7, -3));
  near(x_m, 7);
  near(y_m, -3);
  assert.ok(at(scale.far_m, 0)[1] < 0);
});

test('rings stand at round metres', () => {
  assert.deepEqual([10, 20, 40, 80, 13.7, 4].map(ringsOf), [[2, 4, 6, 8, 10], [5, 10, 15, 20], [10, 20, 30, 40], [20, 40, 60, 80], [5, 10], [1, 2, 3, 4]]);
});

test('zoom halts at the ranges of the keys and ends where the plot ends', () => {
  assert.deepEqual([zoomed(20, 1), zoomed(zoomed(20, 1), 1), zoomed(15, 1), zoomed(15, -1)].map((one) => Math.round(one * 10) / 10), [14.1, 10, 10.6, 20]);
  assert.deepEqual([zoomed(4, 1), zoomed(120, -1), reachWithin(1e9), reachWithin(NaN), reachWithin(-3)], [4, 120, 120, 20, 4]);
  assert.deepEqual([pinched(20, 100, 200), pinched(20, 200, 100), pinched(20, 0, 0), pinched(20, 1e9, 1)], [10, 40, 20, 120]);
});

test('what no beam looks at is not in view, whichever way the laser counts', () => {
  const sectors = (/** @type {any} */ one) => unseenOf(one).map(({ from_rad, to_rad, code }) => [Math.round((10 * from_rad) / DEGREE) / 10, Math.round((10 * to_rad) / DEGREE) / 10, code]);
  assert.deepEqual(sectors(scan(Array(181).fill(500))), []); // ±90°
  assert.deepEqual(sectors(scan(Array(180).fill(500), { angle_min_rad: -89.5 * DEGREE })), []); // its other half
  assert.deepEqual(sectors(scan(Array(360).fill(500), { angle_min_rad: 0 })), []); // all round from the front
  assert.deepEqual(sectors(scan(Array(61).fill(500), { angle_min_rad: -30 * DEGREE })), [[-90, -30.5, NOT_IN_VIEW], [30.5, 90, NOT_IN_VIEW]]);
  assert.deepEqual(sectors(scan([])), [[-90, 90, NOT_IN_VIEW]]);
  assert.deepEqual(sectors(scan(Array(91).fill(500), { angle_min_rad: 135 * DEGREE })), [[-90, 90, NOT_IN_VIEW]]); // it looks back
  assert.equal(unseenOf(scan([500], { angle_min_rad: 0, angle_increment_rad: 0 })).length, 2); // one beam without a width
  assert.deepEqual(sectors(scan(Array(61).fill(500), { angle_min_rad: 30 * DEGREE, angle_increment_rad: -DEGREE })), sectors(scan(Array(61).fill(500), { angle_min_rad: -30 * DEGREE })));
});

test('a laser that looks back shows how much of it is not drawn', () => {
  const back = scan(Array(91).fill(500), { angle_min_rad: 135 * DEGREE });
  assert.equal(behind(back), 91);
  assert.equal(beamWords(back), '91 of 91 beams usable · 91 behind, not drawn');
});

test('the sectors as text, widest first', () => {
  const codes = Array.from({ length: 91 }, (_, i) => (i >= 5 && i < 10 ? TOO_CLOSE : i >= 40 && i < 50 ? NO_RETURN : i === 70 ? INVALID : 500));
  assert.deepEqual(sectorSentences(sectorsOf(scan(codes, { angle_increment_rad: 2 * DEGREE })), 4), ['no return from 9° left to 11° right', 'too close from 71° right to 81° right']);
});

test('of many beams, those whose squares lie upon each other are drawn once, and no place is left out', () => {
  const wall = scan(Array(10_000).fill(500), { angle_increment_rad: Math.PI / 10_000 });
  const drawn = pointsOf(wall, 20, 1 / 22);
  assert.ok(drawn.length / 2 < 400);
  for (let beam = 0; beam < 10_000; beam += 7) {
    const [x, y] = [5 * Math.cos(-Math.PI / 2 + (beam * Math.PI) / 10_000), 5 * Math.sin(-Math.PI / 2 + (beam * Math.PI) / 10_000)];
    let least = Infinity;
    for (let i = 0; i < drawn.length; i += 2) least = Math.min(least, Math.max(Math.abs((drawn[i] ?? 0) - x), Math.abs((drawn[i + 1] ?? 0) - y)));
    assert.ok(least * 22 <= 1.6);
  }
  const apart = Array.from({ length: 1440 }, (_, i) => 300 + 150 * (i % 9));
  assert.equal(pointsOf(scan(apart, { angle_increment_rad: Math.PI / 1440 }), 20, 1 / 22).length / 2, 1440);
  assert.equal(pointsOf(scan(Array(681).fill(500), { angle_increment_rad: Math.PI / 681 }), 20, 1 / 22).length / 2, 681);
});

const CAR = { half_width_m: 1.2, wheelbase_m: 2.62, laser_ahead_m: 2.5, tyre_angle_rad: 0 };

test('a straight corridor', () => {
  assert.deepEqual(edgesOf(CAR, 0, 7), { left: [[0, 1.2], [7, 1.2]], right: [[0, -1.2], [7, -1.2]] });
  assert.equal(endOf(CAR, 20), 20);
});

for (const angle of [0.2, -0.2, 0.6, -0.6, 0.001]) {
  test(`a corridor bent by ${angle} rad lies on the circles of the obstacle check`, () => {
    const bent = { ...CAR, tyre_angle_rad: angle };
    const centre = CAR.wheelbase_m / Math.tan(angle);
    const [rear, nose] = [Math.abs(centre), Math.hypot(CAR.laser_ahead_m, centre)];
    const { left, right } = edgesOf(bent, 0, endOf(bent, 20));
    const [inner, outer] = angle > 0 ? [left, right] : [right, left];
    for (const [x, y] of inner) near(Math.hypot(x + CAR.laser_ahead_m, y - centre), Math.max(0, rear - CAR.half_width_m), 1e-6 * nose);
    for (const [x, y] of outer) near(Math.hypot(x + CAR.laser_ahead_m, y - centre), nose + CAR.half_width_m, 1e-6 * nose);
    // The nose itself is where the way begins; the strip turns to the side the wheels do.
    const [a, b] = [left[0] ?? [0, 0], right[0] ?? [0, 0]];
    assert.ok(a[1] > b[1]);
    const end = outer.at(-1) ?? [0, 0];
    assert.ok(Math.abs(angle) < 0.01 || Math.sign(end[1]) === Math.sign(angle));
  });
}

const ROOM = scan(Array.from({ length: 181 }, (_, i) => (i === 90 ? 830 : i === 76 ? 1240 : i === 60 ? NO_RETURN : 2500)));

test('a touch means the nearest return within a thumb, or none', () => {
  near(nearestTo(ROOM, 8.0, 0.2, 1)?.range_m ?? 0, 8.3);
  assert.equal(nearestTo(ROOM, 4, 0, 1), null);
  assert.equal(nearestTo(scan([]), 0, 0, 1e9), null);
  assert.equal(nearestTo(scan([NO_RETURN, TOO_CLOSE, INVALID, NOTHING_IN_RANGE]), 0, 0, 1e9), null);
});

test('a marked return is followed as it moves, and lost when it jumps away', () => {
  const one = nearestTo(ROOM, 8.3, 0, 0.5);
  assert.ok(one);
  near(follow(scan(ROOM.codes.map((code, i) => (i === 90 ? 775 : code))), one)?.range_m ?? 0, 7.75);
  assert.equal(follow(scan(ROOM.codes.map((code, i) => (i === 90 ? 400 : code))), one), null);
});

test('the arrow keys begin at the nearest and step from return to return', () => {
  const first = nearestShown(ROOM, 20);
  assert.equal(first?.beam, 90);
  assert.ok(first);
  assert.equal(beside(ROOM, first, -1, 20)?.beam, 76); // to the right; what lies beyond the plot is passed over
  assert.equal(beside(ROOM, first, 1, 20)?.beam, 90); // nothing farther left within 20 m
  assert.equal(beside(ROOM, first, 1, 40)?.beam, 92);
  assert.equal(nearestShown(scan([500], { angle_min_rad: Math.PI, angle_increment_rad: 0 }), 20), null); // behind
});

test('a mark stays through a gap of a second, then it is let go; touched again it is taken away', () => {
  const mark = new ScanMark();
  mark.touch(ROOM, 8.3, 0, 1, 0);
  assert.equal(mark.text, '8.3 m, straight ahead');
  assert.equal(mark.hear(scan([]), 900), true);
  assert.equal(mark.isSeen, false);
  assert.equal(mark.hear(ROOM, 950), true);
  assert.equal(mark.isSeen, true);
  assert.equal(mark.hear(scan([]), 1960), false);
  assert.equal(mark.text, '');
  mark.touch(ROOM, 8.3, 0, 1, 0);
  mark.touch(ROOM, 8.3, 0, 1, 0);
  assert.equal(mark.at, null);
  mark.step(ROOM, -1, 20, 0);
  assert.equal(mark.at === null ? null : mark.text, '8.3 m, straight ahead');
  mark.step(ROOM, -1, 20, 0);
  assert.equal(mark.text, '12.4 m, 14° right');
});

test('labels give way to labels: half a line, a line, or they are left out', () => {
  const box = { left: 0, top: 100, width: 40, height: 20 };
  assert.deepEqual(clearOf([], box), box);
  assert.equal(clearOf([{ left: 30, top: 110, width: 40, height: 20 }], box)?.top, 90);
  assert.equal(clearOf([{ left: 30, top: 82, width: 40, height: 20 }], box)?.top, 110);
  assert.equal(clearOf([{ left: 41, top: 100, width: 40, height: 20 }], box)?.top, 100, 'beside it');
  assert.equal(clearOf([{ left: 0, top: 70, width: 40, height: 80 }], box), null);
  assert.equal(clearOf([{ left: 0, top: 3, width: 40, height: 20 }], { ...box, top: 8 })?.top, 28, 'never above the plot');
});

test('a plot too low for its foot still has a scale: what lies ahead is above, and no radius is negative', () => {
  for (const height of [1, 20, 47, 48, 60]) {
    const { k, far_m, at } = plotScale(300, height, 20);
    assert.ok(k > 0 && far_m > 0, String(height));
    assert.ok(at(5, 0)[1] < at(0, 0)[1], String(height));
  }
});

test('labels that would cover a return are found', () => {
  const scale = { cx: 200, cy: 300, k: 10 };
  const box = { left: 100, top: 190, width: 60, height: 20 };
  assert.ok(coversAny(box, [10, 7], scale)); // 10 m ahead and 7 m left is at 130, 200
  assert.ok(coversAny(box, [0, 0, 10, 3.9], scale)); // its square of 5 px reaches into the box
  assert.ok(!coversAny(box, [10, -7, 12.5, 7, 10, 3], scale));
  assert.ok(!coversAny(box, [], scale));
});

test('the number of a ring stands in the first place without a return and without words', () => {
  const scale = { cx: 200, cy: 300, k: 10 };
  const [first, second] = [{ left: 100, top: 190, width: 20, height: 20 }, { left: 250, top: 190, width: 20, height: 20 }];
  assert.deepEqual(clearPlace([first, second], [], [], scale), { index: 0, box: first });
  assert.deepEqual(clearPlace([first, second], [], [10, 9], scale), { index: 1, box: second }); // a return at 110, 200
  assert.deepEqual(clearPlace([first, second], [second], [10, 9], scale), { index: 1, box: { ...second, top: 170 } });
  assert.deepEqual(clearPlace([first], [], [10, 9], scale), { index: -1, box: null });
});

test('the number of a ring stands whole inside of the plot', () => {
  assert.deepEqual([[150, 100], [150, 9], [8, 100], [292, 100]].map((place) => isInView(place, 300)), [true, false, false, false]);
});

test('the distance beside the ring of the nearest object stands whole on the plot, above or below the ring where neither side has room', () => {
  assert.deepEqual(ringWords(100, 80, 400), { way: 1, at: [144, 79, 'left'] });
  assert.deepEqual(ringWords(300, 80, 400), { way: -1, at: [256, 79, 'right'] });
  assert.deepEqual(ringWords(101, 125, 185), { way: 0, at: [101, 91, 'center'] });
  assert.deepEqual(ringWords(20, 30, 130), { way: 0, at: [44, 64, 'center'] });
});

test('a label lies over a sector that the laser sees from where it stands', () => {
  const laser = { x_m: -2, y_m: 0.5 };
  const over = (ends, ...sectors) => liesOverSector(ends.map(([x_m, y_m]) => ({ x_m, y_m })), laser, sectors.map(([from_rad, to_rad]) => ({ from_rad, to_rad, code: 0, beams: 40 })));
  const right = [-0.9, -0.6];
  assert.equal(over([[2, -2], [2, -6]], right), true, 'one end is beside it');
  assert.equal(over([[2, 0], [2, -12]], [-0.72, -0.6]), true, 'both ends are beside it');
  assert.equal(over([[2, 2], [2, 6]], right), false, 'at the left');
  assert.equal(over([[2, -1.5], [2, -2]], right), false, 'beside it from the laser, over it from the car');
  assert.equal(over([[2, -2], [2, -6]], [-0.72, -0.7]), false, 'a single beam');
  assert.equal(over([[2, 2], [2, 6]], [0.4 - 2 * Math.PI, 1 - 2 * Math.PI]), true, 'counted by another turn');
  assert.equal(over([[2, -2], [2, -6]]), false);
});
