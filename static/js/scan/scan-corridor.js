// The corridor as the obstacle check bends it, as lines to draw: pure functions. x is ahead and y left of the car's nose, in metres.

/** A radius of more than five kilometres is straight, as the check has it. */
const STRAIGHT_RAD = 0.0005;
/** A bent edge is drawn in steps of this way along the nose's path [m]. */
const STEP_M = 0.5;

/**
 * @typedef {object} Corridor
 * @property {number} half_width_m
 * @property {number} wheelbase_m
 * @property {number} laser_ahead_m of the rear axle; of the nose, where the laser is behind it
 * @property {number} tyre_angle_rad positive = left
 *
 * @typedef {[number, number]} Point x ahead, y left [m]
 */

/**
 * Left and right edge of the strip from one way along it to another, and what lies across it at each.
 * Kinematic bicycle model, as in the protocol: all points turn about one centre abeam of the rear axle.
 * @param {Corridor} corridor
 * @param {number} from_m along the nose's path
 * @param {number} to_m
 * @returns {{left: Point[], right: Point[]}}
 */
export function edgesOf(corridor, from_m, to_m) {
  const { half_width_m } = corridor;
  if (isStraight(corridor)) {
    return { left: [[from_m, half_width_m], [to_m, half_width_m]], right: [[from_m, -half_width_m], [to_m, -half_width_m]] };
  }
  const turn = turnOf(corridor);
  const steps = Math.max(1, Math.min(400, Math.ceil((to_m - from_m) / STEP_M)));
  const ways = Array.from({ length: steps + 1 }, (_, i) => from_m + ((to_m - from_m) * i) / steps);
  const inner = ways.map((way) => turn.at(turn.inner_m, way));
  const outer = ways.map((way) => turn.at(turn.outer_m, way));
  return turn.side > 0 ? { left: inner, right: outer } : { left: outer, right: inner };
}

/**
 * How far along the corridor it is worth drawing: to the end of the plot, and in a tight bend no farther than until the strip leaves
 * what a beam ahead can reach.
 * @param {Corridor} corridor
 * @param {number} reach_m
 */
export function endOf(corridor, reach_m) {
  if (isStraight(corridor)) return reach_m;
  const turn = turnOf(corridor);
  return Math.min(1.2 * reach_m, turn.nose_m * (Math.PI - 2 * turn.ofNose_rad));
}

/** @param {Corridor} corridor */
function isStraight({ tyre_angle_rad, wheelbase_m }) {
  return Math.abs(tyre_angle_rad) < STRAIGHT_RAD || !(wheelbase_m > 0);
}

/** @param {Corridor} corridor */
function turnOf({ half_width_m, wheelbase_m, laser_ahead_m, tyre_angle_rad }) {
  const centre_m = wheelbase_m / Math.tan(tyre_angle_rad);
  const side = Math.sign(centre_m);
  const nose_m = Math.hypot(laser_ahead_m, centre_m);
  const ofNose_rad = Math.atan2(laser_ahead_m, Math.abs(centre_m));
  return {
    side, nose_m, ofNose_rad,
    inner_m: Math.max(0, Math.abs(centre_m) - half_width_m),
    outer_m: nose_m + half_width_m,
    /** @param {number} radius_m @param {number} way_m @returns {Point} */
    at(radius_m, way_m) {
      const phi = ofNose_rad + way_m / nose_m;
      return [radius_m * Math.sin(phi) - laser_ahead_m, centre_m - side * radius_m * Math.cos(phi)];
    },
  };
}
