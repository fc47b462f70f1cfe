// The texts of control and of who would hear an alarm: pure functions of the newest frame and of events.

import { initialsOf } from './duty-layout.js';
import { counted, fixed } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').ControlState} ControlNow
 * @typedef {import('../core/protocol-types.js').ReachState} ReachNow
 * @typedef {import('../core/protocol-types.js').LogEvent} AlarmEvent
 */

/**
 * The chip in the top bar.
 * @param {ControlNow | null} control null: not received yet
 * @param {string} page this page
 * @param {boolean} isSilent
 * @param {import('../core/protocol-types.js').Duty | null} [duty] who is on duty at this device
 */
export function chipOf(control, page, isSilent, duty = null) {
  if (isSilent || !control) return { text: '?', label: 'Control: the server does not answer, so it is unknown who is in control', is: 'unknown' };
  const me = duty?.me;
  if (control.page && control.page === page) return { text: me ? `${initialsOf(me.name)} controls` : 'You', label: me ? `You are in control, on duty as ${me.name}` : 'You are in control', is: 'you' };
  if (control.holder) return { text: control.holder, label: `${control.holder} is in control`, is: 'other' };
  if (me) return { text: `${initialsOf(me.name)} on duty`, label: `No one is in control. You are on duty as ${me.name}`, is: 'free' };
  return duty?.people ? { text: 'Sign on', label: 'No one is in control. Nobody is on duty here', is: 'free' } : { text: 'No one', label: 'No one is in control', is: 'free' };
}

/**
 * The key that opens the control sheet of a car: what it offers, or who is in control.
 * @param {ReturnType<typeof chipOf>} chip
 * @param {string} car
 * @param {boolean} isViewer
 */
export function controlWords({ label, is }, car, isViewer) {
  if (!car || is === 'unknown') return label;
  if (is === 'free') return isViewer ? `No one is in control of ${car}` : `Take control of ${car}`;
  return `${label} of ${car}`.replace(/(in control)(.*)( of .*)$/, '$1$3$2');
}

/**
 * The line on which pages an alarm would sound.
 * @param {ReachNow | null | undefined} reach
 */
export function reachOf(reach) {
  if (!reach) return { text: 'Alarms audible: not known', why: '', isBad: false };
  if (reach.can === 0) return { text: `Nobody can hear alarms (${reach.of === 0 ? 'no operator' : counted(reach.of, 'operator', 'operators')})`, why: reach.why, isBad: true };
  return { text: `Alarms audible on ${reach.can} of ${counted(reach.of, 'operator page')}`, why: reach.why, isBad: false };
}

/**
 * The notice of a change of control, or null where it is this page's own doing or shown otherwise.
 * @param {AlarmEvent} event
 * @param {string} page
 * @returns {{title: string, text: string, offers: 'take' | 'request' | null} | null}
 */
export function noticeOf(event, page) {
  const { text } = event;
  const [isMine, wasMine, isByMe] = [event.page === page, event.before_page === page, event.by_page === page];
  switch (event.act) {
    case 'requested':
    case 'withdrawn':
      return isMine || isByMe ? null : { title: event.act === 'requested' ? 'Control requested' : 'Request cancelled', text, offers: null };
    case 'kept':
      return isByMe ? null : { title: 'Control is kept', text, offers: null };
    case 'lapsed':
      return wasMine
        ? { title: 'You lost control', text: 'This page was hidden for more than 3 s. Nobody is in control now.', offers: 'take' }
        : { title: 'Nobody is in control', text, offers: 'take' };
    case 'released':
      return isByMe ? null : { title: 'Nobody is in control', text, offers: 'take' };
    case 'returned':
      return { title: isMine ? 'You are in control again' : 'Control is back', text, offers: null };
    case 'taken':
      return isMine ? null : { title: 'Control was taken', text, offers: null };
    default:
      if (isMine) return isByMe ? null : { title: 'You are in control', text, offers: null };
      if (wasMine && isByMe) return null;
      return { title: wasMine ? 'You lost control' : 'Control changed', text, offers: wasMine ? 'request' : null };
  }
}

/**
 * What the sheet offers this page.
 * @param {ControlNow} control
 * @param {ReachNow | null | undefined} reach
 * @param {string} page
 */
export function sheetOf(control, reach, page) {
  const others = (reach?.pages ?? []).filter((one) => one.here && one.page !== page);
  const own = (control.requests ?? []).find((one) => one.page === page);
  const former = control.former && control.former.page !== page ? ` ${control.former.name} can reclaim it for ${seconds(control.former.may_return_s)}.` : '';
  if (control.page === page && page) {
    return { state: 'you', title: 'You are in control', text: 'Only this page can connect, pause, stop and change settings. Any operator can acknowledge alarms.', handTo: others, asked_s: null };
  }
  if (control.holder) {
    const text = own ? `You requested control. It is granted in ${seconds(own.left_s)} unless it is refused.` : 'A request is granted unless it is refused within 10 s. Taking over is announced to everyone.';
    return { state: own ? 'asking' : 'other', title: `${control.holder} is in control`, text, handTo: [], asked_s: own ? own.left_s : null };
  }
  return { state: 'free', title: 'No one is in control', text: `The first to act takes control.${former}`, handTo: [], asked_s: null };
}

/** The oldest request, where this page must answer it. @param {ControlNow | null} control @param {string} page */
export function askedOf(control, page) {
  return control && page && control.page === page ? ((control.requests ?? [])[0] ?? null) : null;
}

/** Whole seconds, begun ones too: what counts down ends at 0. @param {number} value */
export function seconds(value) {
  return `${fixed(Math.ceil(Math.max(0, value)), 0)} s`;
}
