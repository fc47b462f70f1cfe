// Places on WGS84 seen from one of them: metres east and north of it, distance, bearing. Pure functions; no place on Earth
// is special: neither the poles nor the antimeridian.

const A_M = 6_378_137; // semi-major axis of WGS84
const E2 = 6.694_379_990_14e-3; // first eccentricity squared of WGS84
const MEAN_M = 6_371_008.8; // mean radius of the Earth (IUGG)
const RAD = Math.PI / 180;

/**
 * @typedef {{lat_deg: number, lon_deg: number}} Place WGS84
 * @typedef {{east_m: number, north_m: number}} Offset
 */

/**
 * A place as a point in space: Earth-centred, Earth-fixed, on the ellipsoid (Torge, Geodesy, 4.1).
 * @param {Place} place
 * @returns {[number, number, number]}
 */
function point({ lat_deg, lon_deg }) {
  const [sin, cos] = [Math.sin(lat_deg * RAD), Math.cos(lat_deg * RAD)];
  const n_m = A_M / Math.sqrt(1 - E2 * sin * sin);
  return [n_m * cos * Math.cos(lon_deg * RAD), n_m * cos * Math.sin(lon_deg * RAD), n_m * (1 - E2) * sin];
}

/**
 * East and north [m] of `to` as seen from `from`: the direction in which it lies there, at the distance along the ground
 * (azimuthal equidistant). Within 1 mm of the geodesic over 1 km and 0.5 % around the world.
 * @param {Place} from
 * @param {Place} to
 * @returns {Offset}
 */
export function offsetOf(from, to) {
  const [ax, ay, az] = point(from);
  const [bx, by, bz] = point(to);
  const [dx, dy, dz] = [bx - ax, by - ay, bz - az];
  const [sinLat, cosLat, sinLon, cosLon] = [Math.sin(from.lat_deg * RAD), Math.cos(from.lat_deg * RAD), Math.sin(from.lon_deg * RAD), Math.cos(from.lon_deg * RAD)];
  const east = -sinLon * dx + cosLon * dy;
  const north = -sinLat * cosLon * dx - sinLat * sinLon * dy + cosLat * dz;
  const flat = Math.hypot(east, north);
  if (flat === 0) return { east_m: 0, north_m: 0 };
  const chord = Math.hypot(dx, dy, dz);
  const along = 2 * MEAN_M * Math.asin(Math.min(1, chord / (2 * MEAN_M)));
  return { east_m: (east / flat) * along, north_m: (north / flat) * along };
}

/**
 * The place some metres east and north of another; for steps of some kilometres.
 * @param {Place} from
 * @param {Offset} offset
 * @returns {Place}
 */
export function placeAt(from, { east_m, north_m }) {
  const [x, y, z] = point(from);
  const [sinLat, cosLat, sinLon, cosLon] = [Math.sin(from.lat_deg * RAD), Math.cos(from.lat_deg * RAD), Math.sin(from.lon_deg * RAD), Math.cos(from.lon_deg * RAD)];
  const px = x - sinLon * east_m - sinLat * cosLon * north_m;
  const py = y + cosLon * east_m - sinLat * sinLon * north_m;
  const pz = z + cosLat * north_m;
  return { lat_deg: Math.atan2(pz, (1 - E2) * Math.hypot(px, py)) / RAD, lon_deg: Math.atan2(py, px) / RAD };
}

/** @param {Place} from @param {Place} to */
export function distance_m(from, to) {
  const { east_m, north_m } = offsetOf(from, to);
  return Math.hypot(east_m, north_m);
}

/** Compass bearing of one place from another: 0 north, clockwise, 0 ≤ bearing < 360. @param {Place} from @param {Place} to */
export function bearing_deg(from, to) {
  const { east_m, north_m } = offsetOf(from, to);
  return turned(Math.atan2(east_m, north_m) / RAD);
}

/** Any angle within one turn: 0 ≤ angle < 360. @param {number} deg */
export function turned(deg) {
  return ((deg % 360) + 360) % 360;
}

/** The shorter way from one heading to another, −180 < turn ≤ 180, clockwise positive. @param {number} from_deg @param {number} to_deg */
export function turnTo(from_deg, to_deg) {
  const way = turned(to_deg - from_deg);
  return way > 180 ? way - 360 : way;
}

/**
 * How many metres a degree of Mercator's map of the sphere (EPSG:3857) is short of the ellipsoid at a latitude: metres on
 * the ground for one metre of that map, east and north. They differ by up to 0.7 %.
 * @param {number} lat_deg
 */
export function mercatorScale(lat_deg) {
  const [sin, cos] = [Math.sin(lat_deg * RAD), Math.cos(lat_deg * RAD)];
  const w = Math.sqrt(1 - E2 * sin * sin);
  return { east: cos / w, north: (cos * (1 - E2)) / (w * w * w) };
}

/** A place is one only with two finite numbers that are on Earth. @param {any} value @returns {Place | null} */
export function placeOf(value) {
  const { lat_deg, lon_deg } = value ?? {};
  const isOne = Number.isFinite(lat_deg) && Number.isFinite(lon_deg) && Math.abs(lat_deg) <= 90 && Math.abs(lon_deg) <= 360;
  return isOne ? { lat_deg, lon_deg } : null;
}
