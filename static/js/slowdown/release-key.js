// The key that releases the car from a slow-down, and the sheet that confirms it.

import { field, listen, need, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { openSheet } from '../shell/sheet.js';
import { holdOf, keepWords, nameOf, releaseOf, seenOf } from './slow-layout.js';

export class ReleaseKey {
  /**
   * @param {HTMLElement} root
   * @param {import('../core/store.js').Store} store
   * @param {import('../control/control.js').Control} control
   * @param {import('../control/control.js').Say} say
   */
  constructor(root, store, control, say) {
    this.store = store;
    this.control = control;
    this.say = say;
    this.key = field(root, 'release');
    this.label = field(root, 'release-words');
    this.sheet = /** @type {HTMLDialogElement} */ (need(document, '#sheet-release'));
    this.stops = [
      listen(this.key, 'click', () => this.#confirm()),
      listen(field(this.sheet, 'yes'), 'click', () => void this.#release()),
      listen(field(this.sheet, 'no'), 'click', () => this.sheet.close()),
    ];
  }

  /** @param {import('./slow-layout.js').Seen} seen @param {ReturnType<typeof holdOf>} hold */
  draw(seen, hold) {
    const { can, label } = releaseOf(seen);
    show(this.key, hold !== null);
    setText(this.label, label);
    setAttribute(this.key, 'data-barred', !can || null);
    if (this.sheet.open && (!hold || String(hold.number) !== this.sheet.dataset['order'] || this.sheet.dataset['vehicle'] !== this.store.vehicle || !can)) this.sheet.close();
  }

  #confirm() {
    const seen = seenOf(this.store);
    const hold = holdOf(seen.now);
    const { can, why } = releaseOf(seen);
    if (!hold) return;
    if (!can) return this.say(why, 'Not released', seen.isViewer ? undefined : { label: 'Request control', act: () => void this.control.order('request') });
    this.sheet.dataset['order'] = String(hold.number);
    this.sheet.dataset['vehicle'] = this.store.vehicle;
    setText(field(this.sheet, 'no'), keepWords(seen.now?.state));
    setText(field(this.sheet, 'release-title'), `Release ${nameOf(this.store.vehicle) || 'the car'}?`);
    const standing = this.store.frame?.alarms.filter((alarm) => alarm.priority === 'critical' && alarm.active) ?? [];
    setSentence(field(this.sheet, 'alarms'), standing.length ? `Still active: ${standing.map(({ title }) => title).join(', ')}.` : '');
    openSheet(this.sheet);
  }

  async #release() {
    const number = Number(this.sheet.dataset['order']);
    const { vehicle = '' } = this.sheet.dataset;
    this.sheet.close();
    const answer = await this.store.ask('release', { number, vehicle: vehicle || null });
    if (!answer.ok) this.say(answer.reason ?? 'Refused.', 'Not released');
  }
}
