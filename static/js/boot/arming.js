// What the tap on Connect requests of the phone: sound, a screen that stays awake, its position. A refusal is shown.

/**
 * @typedef {'asks' | 'ready' | 'refused' | 'missing'} Armed asks: not requested yet; missing: this browser or page cannot
 * @typedef {{sound: Armed, screen: Armed, position: Armed}} Arms
 */

export class Arming {
  /** @type {WakeLockSentinel | null} */
  #lock = null;
  #isRequested = false;
  /** @type {Armed} */
  screen = 'wakeLock' in navigator ? 'asks' : 'missing';

  /** @param {import('../alarms/alarm-sound.js').AlarmSound} alarmSound @param {import('../phone/phone.js').Phone} phone */
  constructor(alarmSound, phone) {
    this.alarmSound = alarmSound;
    this.phone = phone;
    document.addEventListener('visibilitychange', () => this.#stayAwake());
  }

  /** @returns {Arms} */
  get arms() {
    return { sound: this.#soundArm(), screen: this.screen, position: this.phone.armed };
  }

  /** Within the tap. Nothing here is waited for: the vehicle is connected meanwhile. */
  ask() {
    this.#isRequested = true;
    this.alarmSound.arm();
    this.#stayAwake();
    this.phone.arm();
  }

  #soundArm() {
    if (!this.alarmSound.isPossible) return 'missing';
    if (this.alarmSound.isRunning) return 'ready';
    return this.#isRequested ? 'refused' : 'asks';
  }

  #stayAwake() {
    if (!this.#isRequested || document.hidden || this.screen === 'missing' || (this.#lock && !this.#lock.released)) return;
    navigator.wakeLock.request('screen').then(
      (lock) => {
        this.#lock = lock;
        this.screen = 'ready';
        // The phone releases it while the page is hidden, and it is requested again; a release while the page is visible comes from the battery saver.
        lock.addEventListener('release', () => { if (!document.hidden) this.screen = 'refused'; });
      },
      () => { this.screen = 'refused'; },
    );
  }
}
