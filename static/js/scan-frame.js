// The binary scan frame of docs/protocol.md, decoded.

const MAGIC = 0x53;
const HEADER_BYTES = 28;

/** What a beam without a range says. */
export const NO_RETURN = 0;
export const TOO_CLOSE = 65535;
export const NOTHING_IN_RANGE = 65534;
export const INVALID = 65533;

/**
 * @typedef {object} Scan
 * @property {number} number of this scan since connecting
 * @property {number} age_s at the server when sent
 * @property {number} angle_min_rad
 * @property {number} angle_increment_rad may be negative
 * @property {number} range_max_m
 * @property {number} scale_m metres a unit
 * @property {Uint16Array} codes range / scale, or one of the codes above
 */

/**
 * The scan in a frame, or null where the bytes are no scan of a version known here.
 * @param {ArrayBuffer} bytes
 * @returns {Scan | null}
 */
export function readScan(bytes) {
  if (bytes.byteLength < HEADER_BYTES) return null;
  const view = new DataView(bytes);
  if (view.getUint8(0) !== MAGIC || view.getUint8(1) !== 1) return null;
  const beams = view.getUint16(2, true);
  if (bytes.byteLength < HEADER_BYTES + 2 * beams) return null;
  const scan = {
    number: view.getUint32(4, true),
    age_s: view.getFloat32(8, true),
    angle_min_rad: view.getFloat32(12, true),
    angle_increment_rad: view.getFloat32(16, true),
    range_max_m: view.getFloat32(20, true),
    scale_m: view.getFloat32(24, true),
    codes: littleEndian(bytes, beams),
  };
  const isSound = [scan.angle_min_rad, scan.angle_increment_rad, scan.range_max_m, scan.scale_m].every(Number.isFinite);
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
 * @param {ArrayBuffer} bytes
 * @param {number} beams
 */
function littleEndian(bytes, beams) {
  const view = new DataView(bytes, HEADER_BYTES);
  return Uint16Array.from({ length: beams }, (_, i) => view.getUint16(2 * i, true));
}
