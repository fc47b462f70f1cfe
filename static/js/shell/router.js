// Which screen is in front, and how the operator's choices change it.

import { need, setAttribute, show } from '../core/dom.js';

/** @typedef {import('../core/store.js').Store} Store */

export class Router {
  /** The operator went back to the connect screen while the server may go on. */
  isChoosing = false;
  /** This device is not paired with the server: only the pairing screen is shown. */
  isShut = false;
  /** Alarms that a viewer closed on this phone, by name and occurrence. @type {Set<string>} */
  #closed = new Set();
  /** What link dialog was closed: see lossKey. @type {string | null} */
  answered = null;
  /** A better address, where the server knows one. @type {string | null} */
  suggestion = null;
  /** Called when another screen came in front. @type {() => void} */
  onShown = () => {};

  /**
   * @param {Store} store
   * @param {(sentence: string, title?: string) => void} say
   */
  constructor(store, say) {
    this.store = store;
    this.say = say;
    store.on('switch', () => {
      this.#closed.clear();
      this.isChoosing = false;
      this.answered = this.suggestion = null;
    });
    this.screens = ['pairing', 'start', 'connect', 'monitor'].map((name) => need(document, `#${name}`));
  }

  /** Put the right screen in front. */
  draw() {
    const name = screenOf(this.store, this.isChoosing, this.isShut);
    if (document.body.dataset['screen'] === name && this.screens.some((screen) => screen.id === name && !screen.hidden)) return;
    setAttribute(document.body, 'data-screen', name);
    for (const screen of this.screens) show(screen, screen.id === name);
    this.onShown();
  }

  /** A viewer has seen this alarm: it stays on the strip, and leaves the dialog and the speaker of this phone. @param {import('../core/protocol-types.js').StandingAlarm} alarm */
  closeHere({ id, occurrence }) {
    this.#closed.add(`${id} ${occurrence}`);
  }

  /** The frame without the alarms that were closed here. @template {{alarms: import('../core/protocol-types.js').StandingAlarm[]} | null} Frame @param {Frame} frame @returns {Frame} */
  unclosed(frame) {
    if (!frame || this.#closed.size === 0) return frame;
    return { ...frame, alarms: frame.alarms.filter(({ id, occurrence }) => !this.#closed.has(`${id} ${occurrence}`)) };
  }

  get isMonitorShown() {
    return document.body.dataset['screen'] === 'monitor';
  }

  /** To the connect screen, where a better address is taken over; the server goes on trying meanwhile. */
  choose() {
    this.isChoosing = true;
    this.draw();
    const input = /** @type {HTMLInputElement} */ (need(document, '#address'));
    if (this.suggestion) {
      input.value = this.suggestion;
      input.dispatchEvent(new Event('input'));
      this.suggestion = null;
    }
    input.focus();
  }

  /** An address was sent: what the session does is shown again. */
  chosen() {
    this.isChoosing = false;
    this.answered = null;
  }

  async retry() {
    if (this.store.isSilent) this.store.socket.hurry();
    else if (!this.store.frame?.session.address) this.choose(); // what was typed is no address: there is nothing to dial
    else await this.#ask('retry', 'Not retried');
  }

  async reconnect() {
    const address = this.store.frame?.session.address;
    if (address) await this.#ask('connect', 'Not reconnected', { address });
  }

  /** Leave: monitoring ends, and with it every alarm. */
  async stop() {
    await this.#ask('disconnect', 'Monitoring was not stopped');
  }

  /** Leave a broken link. Where the server itself is gone, only this page leaves. */
  async exit() {
    if (this.store.isSilent || this.store.isViewer) this.choose();
    else await this.stop();
  }

  /**
   * @template {'retry' | 'connect' | 'disconnect'} Kind
   * @param {Kind} kind
   * @param {string} title
   * @param {import('../core/requests.js').FieldsOf<Kind>} [fields]
   */
  async #ask(kind, title, fields) {
    const answer = await this.store.ask(kind, fields);
    if (!answer.ok) this.say(answer.reason ?? 'Refused.', title);
  }
}

/**
 * @param {Pick<Store, 'frame' | 'isMonitoring'>} store
 * @param {boolean} isChoosing
 * @param {boolean} [isShut] this device is not paired
 * @returns {'pairing' | 'start' | 'connect' | 'monitor'}
 */
export function screenOf(store, isChoosing, isShut = false) {
  if (isShut) return 'pairing';
  if (!store.frame) return 'start';
  return store.isMonitoring && !isChoosing ? 'monitor' : 'connect';
}
