import assert from 'node:assert/strict';
import { test } from 'node:test';
import { bearing_deg, distance_m, mercatorScale, offsetOf, placeAt, placeOf, turnTo, turned } from '../../static/js/core/geodesy.js';

/** @param {[number, number]} place */
const at = ([lat_deg, lon_deg]) => ({ lat_deg, lon_deg });
/** @param {number} a @param {number} b @param {number} by */
const near = (a, b, by) => assert.ok(Math.abs(a - b) <= by, `${a} is not within ${by} of ${b}`);

// Geodesics on WGS84 by GeographicLib (Karney 2013): from, to, metres, bearing at the start.
const GEODESICS = /** @type {[[number, number], [number, number], number, number][]} */ ([
  [[32.23, -110.95], [32.2301, -110.9499], 14.5537, 40.36428],
  [[32.23, -110.95], [32.239, -110.945], 1103.6874, 25.27511],
  [[52.5, 13.4], [52.5, 13.4147], 998.2804, 89.99417],
  [[0, 0], [0.001, 0], 110.5743, 0],
  [[-45, 100], [-45.01, 100.02], 1929.0739, 125.18302],
  [[0, 179.9995], [0, -179.9995], 111.3195, 90], // across the antimeridian
  [[-17, -179.9999], [-16.9999, 179.9999], 24.001, 297.4583],
  [[89.9999, 10], [89.9999, -170], 22.3388, 0], // across the pole
  [[90, 0], [89.999, 45], 111.694, 135], // from the pole itself
]);

test('distance and bearing are those of the geodesic, at the poles and across the antimeridian as anywhere', () => {
  for (const [from, to, metres, azimuth] of GEODESICS) {
    near(distance_m(at(from), at(to)), metres, 0.002);
    near(turnTo(azimuth, bearing_deg(at(from), at(to))), 0, 0.002);
  }
});

test('around the world within half a percent', () => {
  const [here, there] = [at([32.23, -110.95]), at([50, 8])];
  near(distance_m(here, there), 9_099_076, 0.005 * 9_099_076);
  near(bearing_deg(here, there), 34.653, 0.3);
  const other = distance_m(at([32.23, -110.95]), at([-32.23, 69.05]));
  assert.ok(Number.isFinite(other) && other > 1.9e7); // the other end of the world lies in every direction
});

test('no way is no direction', () => {
  assert.deepEqual(offsetOf(at([32, -110]), at([32, -110])), { east_m: 0, north_m: 0 });
  assert.equal(bearing_deg(at([90, 0]), at([90, 0])), 0);
});

test('there and back is the same place', () => {
  for (const [from] of GEODESICS) {
    for (const [east_m, north_m] of /** @type {[number, number][]} */ ([[12, -7], [-900, 400], [3000, 3000]])) {
      const back = offsetOf(at(from), placeAt(at(from), { east_m, north_m }));
      near(back.east_m, east_m, 0.01);
      near(back.north_m, north_m, 0.01);
    }
  }
});

test('a place stays on Earth however far it is moved', () => {
  const place = placeAt(at([89.9999, 179.9999]), { east_m: 500, north_m: 500 });
  assert.ok(Math.abs(place.lat_deg) <= 90 && Math.abs(place.lon_deg) <= 180);
});

test('turns', () => {
  assert.equal(turned(-90), 270);
  assert.equal(turned(720), 0);
  assert.equal(turnTo(350, 10), 20);
  assert.equal(turnTo(10, 350), -20);
  assert.equal(turnTo(0, 180), 180);
  assert.equal(turnTo(0, 190), -170);
});

test("a metre of Mercator's map on the ground", () => {
  near(mercatorScale(0).east, 1, 1e-12);
  near(mercatorScale(0).north, 0.993306, 1e-6); // the meridian is bent more than the equator
  near(mercatorScale(60).east, 0.50126, 1e-5);
  near(mercatorScale(90).east, 0, 1e-12);
});

test('what is no place', () => {
  assert.deepEqual(placeOf({ lat_deg: 1, lon_deg: 2, more: 3 }), { lat_deg: 1, lon_deg: 2 });
  for (const none of [null, undefined, {}, { lat_deg: null, lon_deg: null }, { lat_deg: NaN, lon_deg: 0 }, { lat_deg: 0, lon_deg: Infinity }, { lat_deg: 91, lon_deg: 0 }, { lat_deg: '1', lon_deg: 2 }, 'x']) {
    assert.equal(placeOf(none), null);
  }
});
