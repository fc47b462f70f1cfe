// The texts of the paired devices, as pure functions.

import { counted } from '../core/format.js';

const MINUTE_MS = 60_000;
const HOUR_MS = 60 * MINUTE_MS;
const DAY_MS = 24 * HOUR_MS;

/**
 * @typedef {import('../core/protocol-types.js').DeviceRow} Device
 */

/** When it was last here. @param {Pick<Device, 'seen_ms' | 'sockets'>} device @param {number} now_ms by the server's clock */
export function seenWords({ seen_ms, sockets }, now_ms) {
  if (sockets > 0) return 'here now';
  const ago_ms = Math.max(0, now_ms - seen_ms);
  if (ago_ms < 2 * MINUTE_MS) return 'here a moment ago';
  if (ago_ms < HOUR_MS) return `seen ${counted(Math.floor(ago_ms / MINUTE_MS), 'minute')} ago`;
  if (ago_ms < DAY_MS) return `seen ${counted(Math.floor(ago_ms / HOUR_MS), 'hour')} ago`;
  return `seen ${counted(Math.floor(ago_ms / DAY_MS), 'day')} ago`;
}

/**
 * The question before a removal.
 * @param {Device} device
 * @param {string} you id of the device of this page
 * @param {Device[]} all
 * @returns {[string, string]}
 */
export function removalWords(device, you, all) {
  const isLast = device.role === 'operator' && all.filter(({ role }) => role === 'operator').length === 1;
  const last = isLast ? ' It is the last operator: only the server’s terminal can pair another.' : '';
  if (device.id === you) return ['Remove this device?', `This page closes now, and this device must be paired again.${last}`];
  return [`Remove ${device.name}?`, `Its pages close now, and it must be paired again.${last}`];
}

/** How long an invitation still holds, "9:05". @param {number} left_s */
export function leftWords(left_s) {
  const whole = Math.max(0, Math.ceil(left_s));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, '0')}`;
}
