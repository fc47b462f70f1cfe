// Who is on duty at this device: prompts once where there is a list of people, notifies of the end of a duty, shows a hand-over.

import { openDuty, openHandover } from './duty.js';
import { LeftNotice, partOf } from './duty-layout.js';
import { isLeftBehind } from '../alarms/standing.js';
import { request } from './request.js';
import { mustWait } from '../shell/sheet.js';

/** Set once this tab has prompted for who is on duty. */
const PROMPTED = 'catgraph.asked-duty';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('./duty.js').DutyStore} DutyStore
 * @typedef {import('./duty.js').Say} Say
 */

/** Shows once how a duty ended that nobody ended here, where it can be seen; the server keeps the note until it was closed. @param {DutyStore & {name?: string}} store @param {Say} say @returns {() => void} to be called when it changed, and from time to time */
export function dutyEndedNotice(store, say) {
  let shown_ms = 0;
  const onClosed = () => void request('/api/duty/note', { method: 'DELETE' }).catch(() => {}); // it is shown again after a reload
  return () => {
    const ended = store.duty?.ended;
    if (!ended || store.isViewer || ended.at_ms === shown_ms || document.hidden || document.querySelector('dialog:modal')) return;
    shown_ms = ended.at_ms;
    const act = () => {
      onClosed();
      void openDuty(store, say);
    };
    say(ended.text, 'Not on duty any more', { label: 'Sign on', act, onClosed });
  };
}

/** Nothing may open by itself over the slow-down, nor under the finger that orders it. @param {Store} store */
function isSlowing(store) {
  const state = store.frame?.decelerate?.state;
  return state === 'ordered' || state === 'holding' || document.querySelector('.slide[data-moves]') !== null;
}

/** Whether a sheet may open by itself. @param {Store} store */
function mayAsk(store) {
  return store.frame !== null && !isSlowing(store) && !document.querySelector('dialog[open]') && !document.documentElement.hasAttribute('data-replay');
}

/** Prompts once in this tab, and never over another sheet: a person who does not want to sign on closes it. @param {Store} store @param {Say} say */
function asker(store, say) {
  let isPromptedHere = false; // or it cannot be, or it is being opened

  return async () => {
    if (isPromptedHere || !mayAsk(store)) return;
    isPromptedHere = true;
    try {
      if (sessionStorage.getItem(PROMPTED)) return;
      sessionStorage.setItem(PROMPTED, '');
    } catch {
      return; // a page without storage would prompt at each load
    }
    const isOpen = await openDuty(store, say, () => mayAsk(store));
    if (isOpen) sessionStorage.setItem(PROMPTED, '1');
    isPromptedHere = isOpen !== false;
  };
}

/** A person who signs on is shown once what people who are off duty left acknowledged; later it stands in the list of alarms. @param {Store} store @param {Say} say */
function leftBehind(store, say) {
  const notice = new LeftNotice();
  let isOpening = false;

  return () => {
    const { frame, duty } = store;
    const me = duty?.me;
    if (!frame || !me || store.isSilent) return;
    const isDue = notice.isDue(me.since_ms, frame.alarms.some((alarm) => isLeftBehind(alarm, me)), performance.now());
    if (!isDue || isOpening || !mayAsk(store)) return;
    isOpening = true;
    import('./left-sheet.js').then(({ LeftSheet }) => {
      isOpening = false;
      if (mustWait() || !mayAsk(store)) return;
      notice.isShown = true;
      new LeftSheet(store, () => {
        notice.isShown = false;
      });
    }).catch(() => {
      isOpening = false;
      notice.isShown = true;
      say('The alarms that were left behind could not be loaded. They are in the list of alarms.', 'Not opened');
    });
  };
}

/** The sheet of who takes over stands until the end; one that was closed here is behind the chip. Who hands over, or has a slow-down in view, opens it by a key. @param {Store} store @param {Say} say */
function handoverNotice(store, say) {
  let opened = '';
  let isOpening = false;

  return () => {
    const handover = store.isSilent ? null : store.control?.handover;
    const part = partOf(handover, store.page);
    if (!handover || !part) {
      opened = '';
      return;
    }
    const which = `${handover.page} ${handover.since_ms}`;
    if (which === opened || isOpening || document.querySelector('.slide[data-moves]') || document.querySelector('dialog[open]:not(#sheet-cars, #sheet-control, #sheet-duty)')) return;
    if (part === 'giver' || isSlowing(store)) {
      if (document.hidden || document.querySelector('dialog:modal')) return; // it could not be seen
      opened = which;
      const sentence = part === 'taker' ? `${handover.by} hands over to you, with read-back.` : `${handover.name} reads back what is in force. You stay in control until the last line.`;
      say(sentence, 'Control is offered', { label: 'Show', act: () => openHandover(store, say, (isByHand) => { if (!isByHand) opened = ''; }) }); // an alarm closes it: offered again
      return;
    }
    isOpening = true;
    openHandover(store, say, (isByHand) => { if (isByHand) opened = which; }, () => !isSlowing(store));
    setTimeout(() => { isOpening = false; }, 1000);
  };
}

/**
 * @param {import('../core/store.js').Store} store
 * @param {import('./control.js').Say} say
 */
export function mount(store, say) {
  const showEnded = dutyEndedNotice(store, say);
  const askOnce = asker(store, say);
  const drawHandover = handoverNotice(store, say);
  const showLeft = leftBehind(store, say);

  function draw() {
    const { duty } = store;
    if (!duty || store.isViewer) return;
    showEnded();
    showLeft();
    if (!duty.me && duty.people && !duty.ended) void askOnce();
  }

  draw();
  const stops = [
    store.on('duty', draw),
    store.on('draw', () => {
      draw();
      drawHandover();
    }),
  ];
  return () => stops.forEach((stop) => stop());
}
