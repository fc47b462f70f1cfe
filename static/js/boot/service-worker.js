// The page on this phone beyond this visit: the worker that keeps its shell, and the notice of a newer page when it is safe to show it.
// Loaded once the page has begun.

import { need, show } from '../core/dom.js';
import { closeSheet } from '../shell/sheet.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('../core/protocol-types.js').State} State
 * @typedef {'kept' | 'missing' | 'refused' | 'off'} Keeping
 */

const ANSWERED = 'catgraph.answered';
const NOTE_EVERY_MS = 5000;
const OFFER_AGAIN_MS = 10 * 60_000;
const STANDING_MPS = 0.3;

/**
 * Why the page must not be loaded anew now, or null: for some seconds nothing would be seen, and sound needs a touch.
 * @param {State | null} frame
 * @param {{isSilent: boolean, isMonitoring: boolean, hasDialog: boolean}} seen
 */
export function holdsReload(frame, { isSilent, isMonitoring, hasDialog }) {
  if (!frame || isSilent) return 'the server does not answer';
  const alarms = [...frame.alarms, ...(frame.live?.alarms ?? [])].filter(({ state }) => state !== 'SHELVED');
  if (alarms.some(({ priority, state }) => priority === 'critical' || (priority === 'warning' && state !== 'ACKED'))) return 'an alarm is active';
  if (hasDialog) return 'a dialog is open';
  if (frame.replay) return 'a recording is shown';
  if (!['off', 'not_available', 'not_armed', 'armed'].includes(frame.decelerate.state)) return 'the car is being slowed';
  const speed_mps = frame.signals.speed?.value?.speed_mps;
  if (isMonitoring && !(typeof speed_mps === 'number' && Math.abs(speed_mps) < STANDING_MPS)) return 'the car moves';
  return null;
}

export class Shell {
  /** @type {ServiceWorkerRegistration | null} */
  #registration = null;
  #noted_ms = -Infinity;
  #offered_ms = -Infinity;
  #isNew = false;

  /**
   * @param {Store} store
   * @param {(sentence: string, title?: string, way?: import('../shell/notice.js').Way) => void} say
   */
  constructor(store, say) {
    this.store = store;
    this.say = say;
    this.build = document.documentElement.dataset['build'] ?? '';
    this.menu = /** @type {HTMLDialogElement} */ (need(document, '#sheet-menu'));
    this.key = need(this.menu, '[data-f="reload"]');
    this.key.addEventListener('click', () => {
      closeSheet(this.menu);
      this.#reload();
    });
    store.on('tick', () => this.#look());
    store.on('open', () => this.#look());
    this.ready = this.#keep();
  }

  /** Has the worker keep the shell; where the server has none, what an earlier one kept goes. */
  async #keep() {
    const workers = navigator.serviceWorker;
    if (!workers) {
      keeping('missing');
      return;
    }
    try {
      if (document.documentElement.dataset['worker'] === undefined) {
        keeping('off');
        for (const one of await workers.getRegistrations()) await one.unregister();
        for (const name of await caches.keys()) await caches.delete(name);
        return;
      }
      workers.addEventListener('message', ({ data, ports }) => {
        if (data?.kind === 'which') ports[0]?.postMessage(this.build);
      });
      workers.startMessages();
      this.#registration = await workers.register('/worker.js', { scope: '/', updateViaCache: 'none' });
      this.#registration.addEventListener('updatefound', () => this.#follow());
      this.#follow();
      await workers.ready;
      keeping('kept');
    } catch {
      keeping('refused'); // everything works without it, except the message when the server is gone
    }
  }

  /** A worker that waits is the newer one: it may take over where no page of before is open any more. It looks itself. */
  #follow() {
    this.#registration?.waiting?.postMessage({ kind: 'take' });
    const { installing } = this.#registration ?? {};
    installing?.addEventListener('statechange', () => {
      if (installing.state === 'installed') installing.postMessage({ kind: 'take' });
    });
  }

  #look() {
    const { store } = this;
    const now_ms = store.now();
    if (store.heard_ms !== null && !store.isSilent && now_ms - this.#noted_ms >= NOTE_EVERY_MS) {
      this.#noted_ms = now_ms;
      note({ at_ms: store.heard_ms, isMonitoring: store.isMonitoring });
      this.#registration?.waiting?.postMessage({ kind: 'take' }); // a page that was just closed may have kept it waiting
    }
    const isNew = this.build !== '' && store.build !== '' && store.build !== this.build;
    if (isNew && !this.#isNew) this.#registration?.update().catch(() => {});
    this.#isNew = isNew;
    show(this.key, isNew);
    if (!isNew || document.hidden || this.#held() !== null || now_ms - this.#offered_ms < OFFER_AGAIN_MS) return;
    this.#offered_ms = now_ms;
    this.say('A new version is available.', 'catgraph', { label: 'Reload', act: () => this.#reload() });
  }

  #reload() {
    const why = this.#held();
    if (why === null || why === 'the car moves') location.reload();
    else this.say(`Not now: ${why}.`, 'Not reloaded');
  }

  #held() {
    const { frame, isSilent, isMonitoring } = this.store;
    return holdsReload(frame, { isSilent, isMonitoring, hasDialog: document.querySelector('dialog[open]:not([data-docked])') !== null });
  }
}

/** For About. @param {Keeping} how */
function keeping(how) {
  document.documentElement.dataset['shell'] = how;
}

/** For the page that stands in when the server is gone. @param {{at_ms: number, isMonitoring: boolean}} answered */
function note(answered) {
  try {
    localStorage.setItem(ANSWERED, JSON.stringify(answered));
  } catch {
    // no storage: that page will say that it does not know
  }
}
