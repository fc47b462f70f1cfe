// Reports the state of this page once a second: whether it is seen, whether it draws, and whether an alarm would be audible.

/** A report so often while nothing changes [ms]; three are missed before control lapses. */
const EVERY_MS = 1000;
/** An age beyond this is not distinguished [s]. */
const MOST_LAG_S = 86_400;

export class Presence {
  #sent_ms = -Infinity;
  #sent = '';

  /**
   * @param {import('../core/store.js').Store} store
   * @param {import('../boot/arming.js').Arming} arming
   * @param {import('../phone/device-status.js').DeviceStatus} deviceStatus
   * @param {() => string[]} announced the other cars whose next alarm this page would announce
   */
  constructor(store, arming, deviceStatus, announced) {
    this.announced = announced;
    this.store = store;
    this.arming = arming;
    this.deviceStatus = deviceStatus;
    const look = () => this.#look();
    store.on('tick', look);
    store.on('duty', look); // who is on duty is logged with the next report
    store.on('beat', look); // while the page is hidden frames come and its timers hardly run
    store.sync.whenOpen(() => {
      this.#sent_ms = -Infinity;
      look();
    });
    store.on('leave', () => this.#send({ ...this.#report(), leaves: true }));
    document.addEventListener('visibilitychange', look);
    window.addEventListener('pageshow', look);
    window.addEventListener('pagehide', () => this.#send({ ...this.#report(), leaves: true }));
  }

  #report() {
    const { alarmSound, arms } = this.arming;
    return {
      visible: !document.hidden,
      draws: !this.store.painter.drawing.isFailed,
      sound: alarmSound.isInterrupted ? 'interrupted' : arms.sound,
      awake: arms.screen,
      vibrates: this.deviceStatus.vibrates,
      battery: this.deviceStatus.battery,
      charging: this.deviceStatus.charging,
      announces: this.announced(),
    };
  }

  #look() {
    const report = this.#report();
    const key = JSON.stringify([report, this.store.duty]);
    const now_ms = this.store.now();
    if (key === this.#sent && now_ms - this.#sent_ms < EVERY_MS) return;
    if (!this.#send(report)) return;
    this.#sent = key;
    this.#sent_ms = now_ms;
  }

  /** @param {object} report */
  #send(report) {
    const { seal: { named }, sync } = this.store;
    if (!named || !sync.hasGreeted) return false; // before its hello the server would count it as another page
    return this.store.socket.send({ kind: 'present', ...report, ...named, lag_s: Math.min(MOST_LAG_S, this.store.lag_s) });
  }
}
