import assert from 'node:assert/strict';
import { test } from 'node:test';
import { distance_m, offsetOf, placeAt } from '../../static/js/core/geodesy.js';
import {
  CLOSEST, FIRST, WIDEST, between, bounded, clearBox, clearTop, ellipseOf, fitted, gridPaths, gridStep_m, groundMatrix, linesOf, metresOf, overlap, panned, pictureMatrix, pixelOf, scaleBar_m, tileScale,
  upOf, zoomed,
} from '../../static/js/map/map-layout.js';
import { besideWay, inside, nameRoom } from '../../static/js/map/map-figure.js';
import { MOST, Track, trackPaths } from '../../static/js/map/map-track.js';
import { distanceWords } from '../../static/js/core/format.js';
import { apartOf, bearingWords, carOf, phoneOf, pictureWords } from '../../static/js/map/map-text.js';
import { state } from './frames.js';

const HERE = { lat_deg: 32.2319, lon_deg: -110.9501 };
const SIZE = { width: 412, height: 470 };
const PLACES = [HERE, { lat_deg: 0, lon_deg: 180 }, { lat_deg: -17, lon_deg: -179.99999 }, { lat_deg: 89.99999, lon_deg: 40 }, { lat_deg: -90, lon_deg: 0 }, { lat_deg: 70, lon_deg: 25 }];
const view = (more = {}) => ({ centre: HERE, mpp: 0.1, up_deg: 0, ...more });
/** @param {number} a @param {number} b @param {number} by */
const near = (a, b, by) => assert.ok(Math.abs(a - b) <= by, `${a} is not within ${by} of ${b}`);
/** @param {number[]} a @param {number[]} b @param {number} by */
const nearAll = (a, b, by) => { assert.equal(a.length, b.length); a.forEach((one, i) => near(one, b[i] ?? NaN, by)); };

test('the middle is in the middle, north is up and east is right', () => {
  assert.deepEqual(pixelOf(HERE, view(), SIZE), [206, 235]);
  nearAll(pixelOf(placeAt(HERE, { east_m: 10, north_m: 0 }), view(), SIZE), [306, 235], 0.01);
  nearAll(pixelOf(placeAt(HERE, { east_m: 0, north_m: 10 }), view(), SIZE), [206, 135], 0.01);
});

test('with the heading up, what lies ahead is above', () => {
  for (const up_deg of [0, 37, 90, 180, 271.5]) {
    const ahead = placeAt(HERE, { east_m: 10 * Math.sin((up_deg * Math.PI) / 180), north_m: 10 * Math.cos((up_deg * Math.PI) / 180) });
    nearAll(pixelOf(ahead, view({ up_deg }), SIZE), [206, 135], 0.01);
  }
  nearAll(pixelOf(placeAt(HERE, { east_m: 0, north_m: 10 }), view({ up_deg: 90 }), SIZE), [106, 235], 0.01); // north is left
});

test('what is under the finger stays under it, turned or not, anywhere on Earth', () => {
  for (const centre of PLACES) {
    for (const up_deg of [0, 123]) {
      const before = view({ centre, up_deg });
      for (const number of Object.values(panned(before, 1e4, 1e4).centre)) assert.ok(Number.isFinite(number));
      if (Math.abs(centre.lat_deg) > 80) continue; // there north turns with every step
      const under = placeAt(centre, metresOf(60, -80, before));
      nearAll(pixelOf(under, before, SIZE), [266, 155], 0.1);
      nearAll(pixelOf(under, zoomed(before, 2.5, 60, -80), SIZE), [266, 155], 0.1);
      nearAll(pixelOf(under, panned(before, 15, 25), SIZE), [281, 180], 0.1);
    }
  }
});

test('a scale has its bounds', () => {
  assert.deepEqual([bounded(1e9), bounded(0), bounded(-1), bounded(NaN), bounded(0.3)], [WIDEST, CLOSEST, CLOSEST, FIRST, 0.3]);
  assert.equal(zoomed(view(), 1e9).mpp, CLOSEST);
  assert.deepEqual(zoomed(view(), 2).centre, HERE);
});

test('the grid is of 10 and 50 m at the first look, and never crowded', () => {
  assert.equal(gridStep_m(FIRST), 10);
  assert.equal(scaleBar_m(FIRST), 20);
  for (let mpp = CLOSEST; mpp <= WIDEST; mpp *= 1.13) {
    assert.ok(gridStep_m(mpp) / mpp >= 40 && gridStep_m(mpp) / mpp <= 101);
    assert.ok(scaleBar_m(mpp) / mpp <= 150 && scaleBar_m(mpp) / mpp > 59);
  }
});

test('the grid lies still on the ground: lines at whole steps from its origin, every fifth strong', () => {
  const { weak, strong } = gridPaths({ east_m: 3, north_m: -4 }, view(), { width: 200, height: 200 });
  // 5 m a line at 0.1 m/px: x of the lines is 100 + (n·5 − 3)·10
  const upright = [...(weak + strong).matchAll(/M(-?[\d.]+) [\d.-]+L\1 /g)].map((match) => Number(match[1])).sort((a, b) => a - b);
  assert.deepEqual(upright, [-30, 20, 70, 120, 170, 220]);
  const strongAt = [...strong.matchAll(/M(-?[\d.]+) (-?[\d.]+)L(-?[\d.]+) (-?[\d.]+)/g)].map((match) => match.slice(1).map(Number));
  assert.deepEqual(strongAt, [[70, 241.4, 70, -41.4], [-41.4, 60, 241.4, 60]]); // 0 east of the origin, 0 north of it
});

test('two strong lines are five steps apart', () => {
  const { strong } = gridPaths({ east_m: 0, north_m: 0 }, view(), { width: 800, height: 100 });
  const upright = [...strong.matchAll(/M(-?[\d.]+) [\d.-]+L\1 /g)].map((match) => Number(match[1])).sort((a, b) => a - b);
  assert.deepEqual(upright, [150, 400, 650]); // 25 m at 0.1 m/px
});

test('the grid is turned with the map and stays bounded', () => {
  const { strong } = gridPaths({ east_m: 0, north_m: 0 }, view({ up_deg: 90 }), { width: 200, height: 200 });
  assert.ok(strong.includes('M241.4 100L-41.4 100')); // along the north axis, which lies to the left
  for (const mpp of [CLOSEST, 1, WIDEST]) {
    const { weak, strong: fifths } = gridPaths({ east_m: 19_000, north_m: -7 }, view({ mpp, up_deg: 33 }), { width: 1400, height: 1000 });
    assert.ok((weak + fifths).split('M').length < 100);
  }
});

test('the matrix of the ground agrees with a pixel', () => {
  for (const anchor of PLACES.slice(0, 3)) {
    for (const up_deg of [0, 77, 200]) {
      const now = view({ centre: placeAt(anchor, { east_m: 120, north_m: -80 }), up_deg, mpp: 0.5 });
      const [a, b, c, d, e, f] = groundMatrix(offsetOf(anchor, now.centre), now, SIZE);
      const spot = { east_m: 150, north_m: -20 };
      nearAll([a * spot.east_m + c * spot.north_m + e, b * spot.east_m + d * spot.north_m + f], pixelOf(placeAt(anchor, spot), now, SIZE), 0.05);
    }
  }
});

test('the ellipse of a covariance', () => {
  assert.deepEqual(ellipseOf([4, 4, 0], 2), { major_m: 2, minor_m: 2, bearing_deg: 0 });
  assert.deepEqual(ellipseOf([9, 4, 0], 2.5), { major_m: 3, minor_m: 2, bearing_deg: 90 }); // long to the east
  assert.deepEqual(ellipseOf([4, 9, 0], 2.5), { major_m: 3, minor_m: 2, bearing_deg: 0 }); // long to the north
  const skew = ellipseOf([5, 5, 4], 2.2);
  nearAll([skew?.major_m ?? 0, skew?.minor_m ?? 0, skew?.bearing_deg ?? 0], [3, 1, 45], 1e-9); // long to the north-east
  nearAll([ellipseOf([5, 5, -4], 2.2)?.bearing_deg ?? 0], [135], 1e-9);
});

test('without a covariance there is a circle, and without anything nothing', () => {
  assert.deepEqual(ellipseOf(null, 5), { major_m: 5, minor_m: 5, bearing_deg: 0 });
  assert.deepEqual(ellipseOf([1, 1, 7], 5), { major_m: 5, minor_m: 5, bearing_deg: 0 }); // no covariance can be so
  for (const sigma of [null, undefined, 0, -1, NaN, Infinity]) assert.equal(ellipseOf(undefined, sigma), null);
});

test('both are to be seen, with room for keys and names', () => {
  for (const up_deg of [0, 60]) {
    for (const [east_m, north_m] of /** @type {[number, number][]} */ ([[0, 0], [3, 1], [400, -30], [-20, 900], [20_000, 5_000]])) {
      const [car, phone] = [HERE, placeAt(HERE, { east_m, north_m })];
      const found = fitted(view({ up_deg, mpp: FIRST }), SIZE, car, phone, 5);
      assert.ok(found.fits);
      for (const [x, y] of [pixelOf(car, found, SIZE), pixelOf(phone, found, SIZE)]) {
        assert.ok(x >= 83 && x <= 412 - 83 && y >= 75 && y <= 470 - 75, `${x}, ${y} for ${east_m}, ${north_m}`);
      }
    }
  }
});

test('the scale stays while it is good enough, lest the map breathe', () => {
  const phone = placeAt(HERE, { east_m: 40, north_m: 0 });
  const first = fitted(view({ mpp: 50 }), SIZE, HERE, phone);
  assert.ok(first.mpp < 1);
  assert.equal(fitted(first, SIZE, HERE, placeAt(HERE, { east_m: 46, north_m: 3 })).mpp, first.mpp);
  assert.equal(fitted(first, SIZE, HERE, placeAt(HERE, { east_m: 20, north_m: 0 })).mpp, first.mpp);
  assert.ok(fitted(first, SIZE, HERE, placeAt(HERE, { east_m: 60, north_m: 0 })).mpp > first.mpp);
});

test('a phone on another continent is not squeezed into one picture', () => {
  const found = fitted(view(), SIZE, HERE, { lat_deg: 50, lon_deg: 8 });
  assert.equal(found.fits, false);
  assert.deepEqual([found.centre, found.mpp], [HERE, 0.1]);
});

test('which way is up', () => {
  assert.equal(upOf(80, false, 123), 0);
  assert.equal(upOf(80, true, 123), 123);
  assert.equal(upOf(80, true, 82), 80); // trembling
  assert.equal(upOf(359, true, 1), 359);
  assert.equal(upOf(359, true, 5), 5);
  assert.equal(upOf(80, true, null), 80); // standing, stale, unknown: nobody turned
  assert.equal(upOf(80, true, NaN), 80);
});

test('from one view to the next by the shorter turn', () => {
  const to = { centre: placeAt(HERE, { east_m: 10, north_m: 0 }), mpp: 0.4, up_deg: 20 };
  const half = between(view({ up_deg: 340 }), to, 0.5);
  near(half.up_deg, 0, 1e-9);
  near(half.mpp, 0.2, 1e-12);
  near(distance_m(HERE, half.centre), 5, 0.01);
  assert.equal(between(view(), to, 1), to);
});

test('tiles are stretched to true metres', () => {
  const { zoom, x, y } = tileScale(view({ mpp: FIRST }));
  assert.equal(zoom, 20);
  near((40_075_016.686 / 256 / 2 ** 20) * 0.84625 / FIRST, x, 0.001); // cos φ / √(1 − e² sin² φ)
  near(x / y, 1.0048, 0.0002);
  for (const mpp of [CLOSEST, 0.2, 3, WIDEST]) {
    for (const lat_deg of [0, 50, 84]) {
      const found = tileScale({ centre: { lat_deg, lon_deg: 0 }, mpp, up_deg: 0 });
      assert.ok(found.zoom >= 0 && found.zoom <= 24);
      if (found.zoom < 24) assert.ok(found.x > 0.7 && found.x < 1.42);
    }
  }
  assert.ok(Number.isFinite(tileScale({ centre: { lat_deg: 90, lon_deg: 0 }, mpp: 1, up_deg: 0 }).zoom));
});

test('a picture lies with its corners on theirs', () => {
  const corners = [{ east_m: -50, north_m: 30 }, { east_m: 60, north_m: 50 }, { east_m: -60, north_m: -40 }].map((offset) => placeAt(HERE, offset));
  const now = view({ up_deg: 25, mpp: 0.4 });
  const [a = 0, b = 0, c = 0, d = 0, e = 0, f = 0] = pictureMatrix(corners, { width: 800, height: 600 }, now, SIZE);
  const put = (/** @type {number} */ x, /** @type {number} */ y) => [a * x + c * y + e, b * x + d * y + f];
  nearAll(put(0, 0), pixelOf(corners[0] ?? HERE, now, SIZE), 1e-6);
  nearAll(put(800, 0), pixelOf(corners[1] ?? HERE, now, SIZE), 1e-6);
  nearAll(put(0, 600), pixelOf(corners[2] ?? HERE, now, SIZE), 1e-6);
});

// -- texts ------------------------------------------------------------------------------------------------------

const FIX = { lat_deg: 32.2319, lon_deg: -110.9501, status: 0, sigma_m: 5, covariance_m2: [25, 25, 0] };
const PHONE = {
  id: 'a', label: 'Pixel 7 · a3f2', count: 1, handheld: true, ...placeAt(HERE, { east_m: 6, north_m: -8 }), accuracy_m: 5, sigma_m: 3.3, alt_m: null, speed_mps: null,
  heading_deg: null, at_ms: 0, age_s: 0.8, used: true, why: null, why_text: null, apart_m: 10.4, bearing_deg: 323.4, compared_age_s: 0.9, explained_m: 14, correlation: null,
};
/** @param {any} value @param {any} [phone] @param {any} [turn] */
const frameOf = (value, phone = null, turn = { heading_deg: 87 }) => state({ signals: { position: { value }, heading: { value: turn } }, phone, limits: { 'phone_car.least_m': 10 } });
/** @param {any} ink @param {any} [turn] */
const inked = (ink, turn = 'fresh') => (/** @type {string} */ name) => ({ ink: name === 'heading' ? turn : ink, age_s: 3.4 });

test('a car of now, with its ellipse', () => {
  const car = carOf(frameOf(FIX), inked('fresh'));
  assert.deepEqual([car.isLive, car.label, car.message, car.heading_deg, car.isHeadingLive], [true, 'Car ±5 m', '', 87, true]);
  assert.equal(carOf(frameOf({ ...FIX, covariance_m2: [100, 17.64, 0] }), inked('ageing')).label, 'Car ±10 m');
  assert.equal(carOf(frameOf({ ...FIX, covariance_m2: null, sigma_m: 4.2 }), inked('fresh')).label, 'Car ±4.2 m');
});

test('a car that is not known to be there is never shown as live, and the reason is shown', () => {
  for (const [value, ink, text] of /** @type {[any, string, RegExp][]} */ ([
    [FIX, 'stale', /^The car’s position is 3\.4 s old: the car may be elsewhere\.$/],
    [null, 'never', /^No position received/],
    [null, 'no_value', /^The car’s messages hold no usable position\.$/],
    [null, 'not_published', /^The car publishes no position/],
    [{ ...FIX, status: -1 }, 'fresh', /^The car’s receiver has no fix/],
    [{ ...FIX, lat_deg: null, status: -1 }, 'fresh', /^The car’s receiver has no fix/],
  ])) {
    const car = carOf(frameOf(value), inked(ink));
    assert.equal(car.isLive, false);
    assert.match(car.message, text);
  }
  assert.deepEqual(carOf(frameOf(FIX), inked('stale')).label, 'Car STALE 3.4 s');
  assert.equal(carOf(frameOf({ ...FIX, status: -1 }), inked('fresh')).place, null); // coordinates without a fix are none
});

test('unknown quality and unknown heading are named and drawn as that', () => {
  const car = carOf(frameOf({ ...FIX, sigma_m: null, covariance_m2: null }, null, null), inked('fresh', 'not_published'));
  assert.deepEqual([car.ellipse, car.label, car.heading_deg], [null, 'Car, accuracy and heading unknown', null]);
  const standing = carOf(frameOf(FIX), inked('fresh', 'stale'));
  assert.deepEqual([standing.isHeadingLive, standing.label], [false, 'Car ±5 m, heading 3.4 s old']);
});

test('every reason of a phone is shown; a coarse fix is still one of now', () => {
  const live = phoneOf(frameOf(FIX, PHONE), 0.1);
  assert.deepEqual([live.isLive, live.label, live.message], [true, 'Phone ±5 m', '']);
  near(live.age_s ?? 0, 0.9, 1e-9);
  assert.match(phoneOf(frameOf(FIX), 0).message, /^No phone is sharing its position/);
  for (const why of ['denied', 'unavailable', 'timeout', 'insecure', 'hidden', 'old', 'late', 'silent']) {
    const found = phoneOf(frameOf(FIX, { ...PHONE, used: false, why, why_text: `Because of ${why}` }), 0);
    assert.deepEqual([found.isLive, found.message, found.label], [false, `Because of ${why}.`, 'Phone STALE 0.8 s']);
  }
  const coarse = phoneOf(frameOf(FIX, { ...PHONE, accuracy_m: 80, used: false, why: 'coarse', why_text: 'To 80 m only' }), 0);
  assert.deepEqual([coarse.isLive, coarse.label, coarse.message], [true, 'Phone ±80 m, too coarse', 'To 80 m only.']);
  assert.equal(phoneOf(frameOf(FIX, { ...PHONE, lat_deg: null, lon_deg: null, age_s: null, used: false, why: 'denied', why_text: 'No' }), 0).place, null);
  assert.equal(phoneOf(frameOf(FIX, PHONE), 4.5).isLive, false); // the page itself has received nothing for so long
  assert.match(phoneOf(frameOf(FIX, { ...PHONE, count: 3 }), 0).message, /^Compared with Pixel 7 · a3f2, one of 3 phones\.$/);
});

test('apart is as the server compared them at one moment; where it did not, there is no distance, as on Home', () => {
  const frame = frameOf(FIX, PHONE);
  const [car, phone] = [carOf(frame, inked('fresh')), phoneOf(frame, 0)];
  assert.deepEqual(apartOf(frame, 0, car, phone), { distance_m: 10.4, bearing_deg: 323.4, allowed_m: 14 });
  assert.equal(apartOf(frameOf(FIX, { ...PHONE, explained_m: 3 }), 0, car, phone)?.allowed_m, 10);
  for (const given of [{ ...PHONE, used: false, why: 'coarse' }, { ...PHONE, apart_m: null }, { ...PHONE, compared_age_s: 5.1 }]) {
    assert.equal(apartOf(frameOf(FIX, given), 0, car, phone), null);
  }
  assert.equal(apartOf(frame, 0, { ...car, isLive: false }, phone), null);
  assert.equal(apartOf(frame, 0, car, { ...phone, isLive: false }), null);
});

test('distances, bearings and the picture as text', () => {
  assert.deepEqual([0, 10.44, 99.96, 320.4, 1234, 99_960, 9_099_076].map((one) => distanceWords(one).join(' ')), ['0.0 m', '10.4 m', '100 m', '320 m', '1.2 km', '100 km', '9099 km']);
  assert.equal(bearingWords(323.4), '323° NW');
  const frame = frameOf(FIX, PHONE);
  const [car, phone] = [carOf(frame, inked('fresh')), phoneOf(frame, 0)];
  assert.equal(pictureWords(car, phone, apartOf(frame, 0, car, phone)), 'Map: the car is 10.4 m from the phone, at 323° NW of it');
  assert.equal(pictureWords(car, { ...phone, isLive: false }, null), 'Map: the car');
  assert.equal(pictureWords({ ...car, isLive: false }, { ...phone, isLive: false }, null), 'Map: no current position');
  assert.equal(pictureWords({ ...car, place: null, isLive: false }, { ...phone, place: null, isLive: false }, null), 'Map: no position');
});

// -- the track ---------------------------------------------------------------------------------------------------------

/** @param {number} number @param {number} east_m @param {number} [at_s] @param {number} [joins] */
const row = (number, east_m, at_s = number, joins = 0) => {
  const { lat_deg, lon_deg } = placeAt(HERE, { east_m, north_m: 0 });
  return [number, lat_deg, lon_deg, at_s, joins];
};

test('a page that comes late requests all of the track, and then what is new', () => {
  const track = new Track();
  assert.equal(track.lacks('a 1', 0), null);
  assert.equal(track.lacks('a 1', 7), 0);
  track.take('a 1', [row(1, 0), row(4, 2), row(7, 4)]);
  assert.equal(track.lacks('a 1', 7), null);
  assert.equal(track.lacks('a 1', 9), 7);
  track.take('a 1', [row(7, 4), row(8, 5), row(9, 6)]); // answered twice: nothing is there twice
  assert.deepEqual(track.points.map((point) => point.number), [1, 4, 7, 8, 9]);
});

test('another number or another run of the server is another track', () => {
  const track = new Track();
  track.lacks('a 1', 2);
  track.take('a 1', [row(1, 0), row(2, 1)]);
  assert.equal(track.lacks('a 2', 0), null);
  assert.deepEqual(track.points, []);
  track.take('a 1', [row(1, 0)]); // an answer that was under way
  assert.deepEqual(track.points, []);
  assert.equal(track.lacks('b 2', 5), 0);
});

test('rows that are none are left out, and a track is bounded', () => {
  const track = new Track();
  track.lacks('a 1', 1);
  for (const rows of [null, 'x', {}, [null, [1], [1, 2, 3, 4], [NaN, 1, 1, 1, 0], [1, 91, 0, 0, 0], ['1', 1, 1, 1, 0]]]) track.take('a 1', rows);
  assert.deepEqual(track.points, []);
  track.take('a 1', Array.from({ length: 3 * MOST }, (_, i) => row(i + 1, i)));
  assert.ok(track.points.length <= MOST && track.last === 3 * MOST);
});

test('lines end where the way is not known; what was not seen is distinguished; a dot each ten seconds', () => {
  const track = new Track();
  track.lacks('a 1', 9);
  track.take('a 1', [row(1, 0, 101), row(2, 5, 104), row(3, 10, 111), row(4, 20, 140, 1), row(5, 25, 149), row(6, 900, 150, 2), row(7, 905, 161)]);
  const { driven, unseen, dots } = trackPaths(track.points, HERE);
  const flat = (/** @type {string} */ path) => path.replaceAll(/([\d.-]+) -?0\.0\d/g, (_, east) => String(Math.round(east)));
  assert.equal(flat(driven), 'M0L5L10M20L25M900L905');
  assert.equal(flat(unseen), 'M10L20');
  assert.equal(flat(dots), 'M10h0M905h0');
  assert.deepEqual(trackPaths([], HERE), { driven: '', unseen: '', dots: '' });
});

// -- the figure's places -------------------------------------------------------------------------------------------------

test('the part of a way that is on the map', () => {
  assert.deepEqual(inside([10, 10], [100, 200], SIZE), [[10, 10], [100, 200]]);
  assert.deepEqual(inside([206, 235], [206, -235], SIZE), [[206, 235], [206, 0]]);
  assert.deepEqual(inside([-100, 100], [500, 100], SIZE), [[0, 100], [412, 100]]);
  assert.equal(inside([-10, 0], [-10, 400], SIZE), null);
  assert.equal(inside([-50, -10], [500, -300], SIZE), null);
  assert.deepEqual(inside([1e7, 235], [206, 235], SIZE)?.[0], [412, 235]);
});

test('the number stands beside its way and never on it', () => {
  for (let turn = 0; turn < 360; turn += 15) {
    for (const middle of /** @type {[number, number][]} */ ([[206, 235], [30, 60], [380, 420], [206, 20]])) {
      const [dx, dy] = [50 * Math.cos((turn * Math.PI) / 180), 50 * Math.sin((turn * Math.PI) / 180)];
      const [x, y] = besideWay([[middle[0] - dx, middle[1] - dy], [middle[0] + dx, middle[1] + dy]], SIZE);
      assert.ok(x >= 36 && x <= 412 - 36 && y >= 20 && y <= 470 - 60, `${x}, ${y}`);
      if (middle[0] === 206 && middle[1] === 235) {
        const off = Math.abs((x - middle[0]) * dy - (y - middle[1]) * dx) / 50; // from the way
        assert.ok(off >= 14 + (Math.abs(dy) * 36 + Math.abs(dx) * 20) / 50 - 1e-6);
      }
    }
  }
  assert.ok(besideWay([[252, 312], [206, 250]], SIZE)[0] < 206); // as the pictures of the design have it: at the left
});

test('a label is drawn where nothing is taken, as near to its place as possible, or not at all', () => {
  const keys = { left: 218, top: 80, width: 188, height: 44 };
  const head = { left: 64, top: 0, width: 412, height: 28 };
  const label = { left: 210, top: 90, width: 90, height: 19 };
  assert.equal(clearTop(label, [], 130), 90);
  const top = clearTop(label, [keys, head], 130);
  assert.ok(top !== null && top < 80 && top > 40, String(top));
  assert.ok(![keys, head].some((one) => overlap({ ...label, top: top ?? 0 }, one)));
  assert.equal(clearTop({ ...label, top: 2 }, [keys, head], 130), 29);
  assert.equal(clearTop(label, [{ left: 0, top: 0, width: 400, height: 130 }], 130), null);
  assert.equal(clearTop({ ...label, left: 10 }, [keys, head], 130), 90); // beside the keys
});

test('a name that finds no room near its place stands beside its mark, right of it before left', () => {
  const size = { width: 360, height: 130 };
  const mark = { left: 164, top: 84, width: 32, height: 32 };
  const name = { left: 135, top: 122, width: 90, height: 19 }; // below the mark there is no room for it
  const sides = [196, 74].map((left) => ({ ...name, left, top: 90.5 }));
  assert.deepEqual(clearBox({ ...name, top: 60 }, sides, [mark], size), { ...name, top: 60 });
  const above = { left: 0, top: 0, width: 360, height: 60 };
  assert.deepEqual(clearBox({ ...name, top: 99 }, sides, [mark, above], size)?.top, 64); // a line above its mark
  const heads = { left: 0, top: 0, width: 360, height: 83 };
  assert.deepEqual(clearBox(name, sides, [mark, heads], size), sides[0]);
  const keys = { left: 240, top: 60, width: 120, height: 70 };
  assert.deepEqual(clearBox(name, sides, [mark, heads, keys], size), sides[1]);
  assert.equal(clearBox(name, sides, [mark, heads, keys, { left: 0, top: 60, width: 164, height: 70 }], size), null);
});

test('the name of a phone stands beside it also where the circle of its accuracy is wider than the map', () => {
  assert.deepEqual([0, 40, 444].map(nameRoom), [18, 40, 18]);
});

test('the bar of the scale keeps to the room that the keys leave', () => {
  for (let mpp = CLOSEST; mpp <= WIDEST; mpp *= 1.07) {
    for (const room of [150, 134, 72]) assert.ok(scaleBar_m(mpp, room) / mpp <= room, `${mpp} ${room}`);
  }
  assert.equal(scaleBar_m(FIRST, 134), 10);
});

test('a name that is wider than the map has as few lines as it needs, about equally long', () => {
  const name = 'Car, accuracy unknown, heading 12.0 s old';
  assert.deepEqual(linesOf(name, 42), [name]);
  assert.deepEqual(linesOf(name, 36), ['Car, accuracy unknown,', 'heading 12.0 s old']);
  assert.deepEqual(linesOf('Car ±5 m', 3), ['Car', '±5', 'm']);
});
