// What the phone tells of itself beside sound and position: battery, network, vibration, and whether it is an iPhone.

/** @typedef {EventTarget & {level: number, charging: boolean}} Battery */

/**
 * Every browser of an iPhone or iPad is Safari beneath; an iPad calls itself a Mac, but no Mac is touched.
 * @param {string} userAgent
 * @param {number} touchPoints
 */
export function isApple(userAgent, touchPoints) {
  return /iPhone|iPad|iPod/.test(userAgent) || (/Macintosh/.test(userAgent) && touchPoints > 1);
}

export class DeviceStatus {
  /** 0 … 1; null: this browser does not tell. @type {number | null} */
  battery = null;
  /** @type {boolean | null} */
  charging = null;
  isApple = isApple(navigator.userAgent, navigator.maxTouchPoints);
  /** A desktop computer has the function and no vibration motor. */
  vibrates = typeof navigator.vibrate === 'function' && matchMedia('(pointer: coarse)').matches;

  constructor() {
    const { getBattery } = /** @type {{getBattery?: () => Promise<Battery>}} */ (/** @type {unknown} */ (navigator));
    getBattery?.call(navigator).then((battery) => {
      const note = () => {
        this.battery = Number.isFinite(battery.level) ? Math.min(1, Math.max(0, battery.level)) : null;
        this.charging = battery.charging;
      };
      note();
      battery.addEventListener('levelchange', note);
      battery.addEventListener('chargingchange', note);
    }, () => {});
  }

  get isOnline() {
    return navigator.onLine;
  }

  /** wifi, cellular …; '' where the browser does not tell. */
  get network() {
    const { connection } = /** @type {{connection?: {type?: string, effectiveType?: string}}} */ (/** @type {unknown} */ (navigator));
    return connection?.type ?? connection?.effectiveType ?? '';
  }
}
