// The binary scan frame of docs/protocol.md, decoded.

const MAGIC = 0x53;
const VERSION = 2;
const HEADER_BYTES = 32;
/** Units from 0 to range_max. */
const STEPS = 65000;
const ANGLE_STEP_RAD = 0.005;
const STOPPING_UNKNOWN = 65535;

/** The value of a beam without a range. */
export const NO_RETURN = 0;
export const TOO_CLOSE = 65535;
export const NOTHING_IN_RANGE = 65534;
export const INVALID = 65533;

/** In the place of the nearest beam: too little of the corridor was seen; 65535, as any beam there is not: nothing stands in it. */
const BLIND = 65534;

/**
 * @typedef {object} Scan
 * @property {number} number of this scan since connecting
 * @property {number} age_s at the server when sent
 * @property {number} angle_min_rad
 * @property {number} angle_increment_rad may be negative
 * @property {number} range_max_m
 * @property {number} scale_m metres a unit
 * @property {number} [x_m] place of the laser ahead of the car's nose: 0, or negative; the state has it, the frame has not
 * @property {number} [y_m] place of the laser to the left of the nose, likewise
 * @property {Judged} judged
 * @property {Uint16Array} codes range / scale, or one of the codes above
 *
 * @typedef {object} Judged what the obstacle check made of it
 * @property {number} tyre_angle_rad of the corridor, positive = left
 * @property {number} wider_m than its half-width by the settings
 * @property {number | null} gap_m along the corridor to the nearest thing
 * @property {number | null} beam that saw it; null too where it is of another part of a sweep that is sent in parts
 * @property {boolean} isBlind too little of the corridor was seen to tell whether something stands in it
 * @property {number | null} stopping_m null: the speed is not known
 */

/**
 * The scan in a frame, or null where the bytes are no scan of a version known here.
 * @param {ArrayBuffer} bytes
 * @returns {Scan | null}
 */
export function readScan(bytes) {
  if (bytes.byteLength < HEADER_BYTES) return null;
  const view = new DataView(bytes);
  if (view.getUint8(0) !== MAGIC || view.getUint8(1) !== VERSION) return null;
  const beams = view.getUint16(2, true);
  if (bytes.byteLength < HEADER_BYTES + 2 * beams) return null;
  const range_max_m = view.getFloat32(20, true);
  const stopping_cm = view.getUint16(10, true);
  const beam = view.getUint16(30, true);
  const gap_m = view.getFloat32(24, true);
  const scan = {
    number: view.getUint32(4, true),
    age_s: view.getUint16(8, true) / 1000,
    angle_min_rad: view.getFloat32(12, true),
    angle_increment_rad: view.getFloat32(16, true),
    range_max_m,
    scale_m: Math.max(range_max_m, 0.1) / STEPS,
    judged: {
      tyre_angle_rad: view.getInt8(28) * ANGLE_STEP_RAD,
      wider_m: view.getUint8(29) / 100,
      gap_m: gap_m > 0 ? gap_m : null,
      beam: beam < beams && gap_m > 0 ? beam : null,
      isBlind: beam === BLIND,
      stopping_m: stopping_cm === STOPPING_UNKNOWN ? null : stopping_cm / 100,
    },
    codes: littleEndian(bytes, beams),
  };
  const isSound = [scan.angle_min_rad, scan.angle_increment_rad, scan.range_max_m, gap_m].every(Number.isFinite);
  return isSound ? scan : null;
}

/**
 * Range of a beam in metres, or null where it has none.
 * @param {Scan} scan
 * @param {number} beam
 */
export function rangeOf(scan, beam) {
  const code = scan.codes[beam] ?? NO_RETURN;
  return code === NO_RETURN || code >= INVALID ? null : code * scan.scale_m;
}

/**
 * Bearing of a beam, counter-clockwise, 0 ahead, from −π to π: the laser may count its angles from anywhere.
 * @param {Scan} scan
 * @param {number} beam
 */
export function bearingOf(scan, beam) {
  return withinHalfTurn(scan.angle_min_rad + beam * scan.angle_increment_rad);
}

/**
 * The same bearing from −π to π.
 * @param {number} bearing_rad
 */
export function withinHalfTurn(bearing_rad) {
  return Math.abs(bearing_rad) <= Math.PI ? bearing_rad : bearing_rad - 2 * Math.PI * Math.round(bearing_rad / (2 * Math.PI));
}

const IS_LITTLE_ENDIAN = new Uint8Array(Uint16Array.of(1).buffer)[0] === 1;

/**
 * @param {ArrayBuffer} bytes
 * @param {number} beams
 */
function littleEndian(bytes, beams) {
  if (IS_LITTLE_ENDIAN) return new Uint16Array(bytes, HEADER_BYTES, beams);
  const view = new DataView(bytes, HEADER_BYTES);
  return Uint16Array.from({ length: beams }, (_, i) => view.getUint16(2 * i, true));
}
