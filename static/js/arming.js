// What the tap on Connect asks of the phone: sound, a screen that stays awake, its position. What is refused is said.

/**
 * @typedef {'asks' | 'ready' | 'refused' | 'missing'} Armed asks: not asked yet; missing: this browser or page cannot
 * @typedef {{sound: Armed, screen: Armed, position: Armed}} Arms
 */

export class Arming {
  /** @type {WakeLockSentinel | null} */
  #lock = null;
  #isAsked = false;
  /** @type {Armed} */
  screen = 'wakeLock' in navigator ? 'asks' : 'missing';
  /** @type {Armed} */
  position = window.isSecureContext && 'geolocation' in navigator ? 'asks' : 'missing';

  /** @param {import('./voice.js').Voice} voice */
  constructor(voice) {
    this.voice = voice;
    document.addEventListener('visibilitychange', () => this.#stayAwake());
    // Browsers tell beforehand only what was answered before; this asks nothing of anybody.
    navigator.permissions?.query({ name: 'geolocation' }).then((permission) => {
      const note = () => {
        if (this.position === 'missing') return;
        this.position = permission.state === 'granted' ? 'ready' : permission.state === 'denied' ? 'refused' : 'asks';
      };
      note();
      permission.onchange = note;
    }, () => {});
  }

  /** @returns {Arms} */
  get arms() {
    return { sound: this.#soundArm(), screen: this.screen, position: this.position };
  }

  /** Within the tap. Nothing here is waited for: the vehicle is connected meanwhile. */
  ask() {
    this.#isAsked = true;
    this.voice.arm();
    this.#stayAwake();
    if (this.position === 'missing') return;
    navigator.geolocation.getCurrentPosition(
      () => { this.position = 'ready'; },
      (error) => { this.position = error.code === error.PERMISSION_DENIED ? 'refused' : 'ready'; },
      { enableHighAccuracy: true, timeout: 10000 },
    );
  }

  #soundArm() {
    if (!this.voice.isPossible) return 'missing';
    if (this.voice.isRunning) return 'ready';
    return this.#isAsked ? 'refused' : 'asks';
  }

  #stayAwake() {
    if (!this.#isAsked || document.hidden || this.screen === 'missing' || (this.#lock && !this.#lock.released)) return;
    navigator.wakeLock.request('screen').then(
      (lock) => { this.#lock = lock; this.screen = 'ready'; },
      () => { this.screen = 'refused'; },
    );
  }
}
