// One dialog at a time: which, and what stands in it. Alarms and broken links open by themselves and close by themselves.

import { isAboutLink, layOut } from './alarm-layout.js';
import { drawBigChain } from './chain.js';
import { field, html, listen, need, setIcon, setText, setWords, show, words } from './dom.js';
import { isAsked } from './sheet.js';
import { shownIn } from './units.js';
import { dialogWords } from './standing.js';
import { age, counted, fixed, timeOfDay } from './words.js';

/** A silent server is covered by the veil at once; the dialog waits for what a change of radio cell takes [s]. */
const LOST_AFTER_S = 4;

/**
 * @typedef {import('./protocol.js').Alarm} Alarm
 * @typedef {import('./protocol.js').State} State
 * @typedef {{kind: 'alarm', alarm: Alarm} | {kind: 'lost' | 'mute' | 'failed', alarm: Alarm | null}} Dialog
 */

/**
 * Which dialog must stand now.
 * @param {object} seen
 * @param {State | null} seen.frame
 * @param {boolean} seen.isSilent
 * @param {number} seen.silence_s
 * @param {boolean} seen.isChoosing the operator went to the connect screen
 * @param {boolean} seen.isAnswered the operator closed the dialog about this loss or this failure
 * @returns {Dialog | null}
 */
export function dialogOf({ frame, isSilent, silence_s, isChoosing, isAnswered }) {
  if (!frame) return null;
  const { phase, paused } = frame.session;
  if (frame.replay && !isSilent) return null; // what asked then asks nobody now; what is live asks through replay.js
  const isWatching = phase === 'monitoring' || phase === 'lost';
  if (isSilent) return isWatching && !isChoosing && !isAnswered && silence_s > LOST_AFTER_S ? { kind: 'lost', alarm: null } : null;
  if (phase === 'failed') return isChoosing || isAnswered ? null : { kind: 'failed', alarm: layOut(frame.alarms).dialog };
  if (!isWatching || paused) return null;
  const { dialog } = layOut(frame.alarms);
  if (dialog && !isAboutLink(dialog)) return { kind: 'alarm', alarm: dialog };
  if (isChoosing) return null;
  if (phase === 'lost' || frame.link.cut === 'server-bridge') return isAnswered ? null : { kind: 'lost', alarm: dialog };
  if (dialog) return isAnswered ? null : { kind: dialog.priority === 'critical' ? 'lost' : 'mute', alarm: dialog };
  if (frame.link.cut === 'bridge-car' && frame.link.topics_heard === 0) return isAnswered ? null : { kind: 'mute', alarm: null };
  return null;
}

/**
 * What a link dialog is about: answered once, it stays closed until this changes.
 * @param {State | null} frame
 * @param {boolean} isSilent
 */
export function lossKey(frame, isSilent) {
  if (!frame) return 'none';
  if (isSilent) return `server ${frame.server.boot}`;
  const { phase } = frame.session;
  if (phase === 'failed') return `failed ${frame.session.address} ${frame.link.problem?.code}`;
  if (phase === 'lost') return `lost ${frame.link.since_ms === null ? '' : Math.round(frame.link.since_ms / 5000)}`;
  return frame.link.cut === null ? 'none' : `${frame.link.cut} ${frame.session.address}`;
}

/**
 * @param {import('./store.js').Store} store
 * @param {import('./page.js').Page} page
 */
export function mount(store, page) {
  const sheets = /** @type {Record<Dialog['kind'], HTMLDialogElement>} */ (Object.fromEntries(
    ['alarm', 'lost', 'mute', 'failed'].map((kind) => [kind, need(document, `#sheet-${kind}`)])));
  /** @type {Dialog | null} */
  let standing = null;
  /** @type {(() => void)[]} */
  const stops = [store.on('draw', draw), store.on('tick', () => document.hidden && judge())];

  for (const sheet of Object.values(sheets)) {
    // Escape and the phone's back key mean: I have seen it.
    stops.push(listen(sheet, 'cancel', (event) => {
      event.preventDefault();
      answer();
    }));
    // Some browsers close without asking; what is not acknowledged comes back with the next frame.
    stops.push(listen(sheet, 'close', () => {
      if (standing && sheets[standing.kind] === sheet && !store.drawing.isFailed && !store.isStopped) answer();
    }));
  }
  on(sheets.alarm, 'acknowledge', answer);
  on(sheets.lost, 'retry', () => (store.chain.cut === 2 ? page.reconnect() : page.retry()));
  on(sheets.lost, 'change', () => page.choose());
  on(sheets.lost, 'exit', () => page.exit());
  on(sheets.mute, 'retry', () => page.reconnect());
  on(sheets.mute, 'exit', () => page.exit());
  on(sheets.failed, 'retry', () => page.retry());
  on(sheets.failed, 'change', () => page.choose());

  /** @param {HTMLDialogElement} sheet @param {string} name @param {() => void} act */
  function on(sheet, name, act) {
    stops.push(listen(field(sheet, name), 'click', act));
  }

  async function answer() {
    if (!standing) return;
    const { kind, alarm } = standing;
    if (kind !== 'alarm') page.answered = lossKey(store.frame, store.isSilent);
    if (alarm && store.isViewer) page.closeHere(alarm);
    else if (alarm) {
      const reply = await store.ask('acknowledge', { alarm: alarm.id, occurrence: alarm.occurrence });
      if (!reply.ok && kind === 'alarm') page.say(reply.reason ?? 'Refused.', 'Not acknowledged');
    }
    draw();
  }

  function judge() {
    const key = lossKey(store.frame, store.isSilent);
    if (page.answered !== null && page.answered !== key && key === 'none') page.answered = null;
    standing = store.drawing.isFailed ? null : dialogOf({ // else undrawn.js names the alarms
      frame: page.unclosed(store.frame), isSilent: store.isSilent, silence_s: store.silence_s,
      isChoosing: page.isChoosing, isAnswered: page.answered === key,
    });
    return standing;
  }

  function draw() {
    judge();
    const wanted = standing ? sheets[standing.kind] : null;
    if (wanted && !wanted.open) {
      for (const sheet of /** @type {NodeListOf<HTMLDialogElement>} */ (document.querySelectorAll('dialog[open]'))) {
        if (isAsked(sheet)) sheet.close();
      }
    }
    for (const sheet of Object.values(sheets)) if (sheet !== wanted && sheet.open) sheet.close();
    if (!standing || !wanted) return;
    if (standing.kind === 'alarm') fillAlarm(wanted, standing.alarm);
    else fillLink(wanted, standing.kind, store);
    if (standing.kind === 'lost') setText(field(wanted, 'title'), standing.alarm?.title ?? 'Connection lost');
    if (standing.kind === 'failed') setWords(field(wanted, 'change'), page.suggestion ? `Use ${page.suggestion}` : 'Change the address');
    if (!wanted.open) {
      wanted.showModal();
      need(wanted, 'button').focus();
    }
  }

  if (store.frame) draw();
  return () => stops.forEach((stop) => stop());
}

/**
 * @param {HTMLElement} sheet
 * @param {Alarm} alarm
 */
function fillAlarm(sheet, alarm) {
  sheet.dataset['priority'] = alarm.priority;
  setIcon(need(sheet, 'h2 .i'), alarm.priority === 'critical' ? 'crit' : 'warn');
  setText(field(sheet, 'title'), alarm.title);
  const { measured, limit } = alarm;
  show(field(sheet, 'versus'), measured !== null && limit !== null);
  if (measured && limit) {
    for (const [name, quantity] of /** @type {const} */ ([['measured', measured], ['limit', limit]])) {
      const { value, unit } = shownIn(quantity.value, quantity.unit);
      setText(field(sheet, name), fixed(value));
      setText(field(sheet, `${name}-unit`), unit);
    }
  }
  setWords(field(sheet, 'text'), dialogWords(alarm));
}

/**
 * @param {HTMLElement} sheet
 * @param {'lost' | 'mute' | 'failed'} kind
 * @param {import('./store.js').Store} store
 */
function fillLink(sheet, kind, store) {
  const view = store.chain;
  drawBigChain(field(sheet, 'chain'), view);
  const [bold, plain, more] = linkWords(kind, view, store.frame);
  const text = field(sheet, 'words');
  const key = `${bold}|${plain}`;
  if (text.dataset['told'] !== key) {
    text.replaceChildren(html('b', {}, ...words(bold)), ' ', ...words(plain));
    text.dataset['told'] = key;
  }
  setWords(field(sheet, 'more'), more);
}

/**
 * One bold sentence of what fell silent, what is known, and what to do.
 * @param {'lost' | 'mute' | 'failed'} kind
 * @param {import('./link.js').ChainView} view
 * @param {State | null} frame
 * @returns {[string, string, string]}
 */
export function linkWords(kind, view, frame) {
  const link = frame?.link;
  const tried = link && link.attempts > 0 ? `Tried ${times(link.attempts)} in ${age(link.trying_for_s)} s.` : '';
  if (kind === 'failed') return [view.sentence, '', [link?.problem?.hint, tried].filter(Boolean).join(' ')];
  if (kind === 'mute') {
    const heard = link ? `${link.topics_heard} of ${link.topics_subscribed} topics sent data.` : '';
    return [view.sentence, heard, view.detail];
  }
  const isServer = view.cut === 0;
  const again = view.cut !== 1 ? view.detail : `The server is there and dials again${link?.attempts ? `; ${counted(link.attempts, 'try', 'tries')} so far` : ''}.`;
  return [view.sentence, again, `The car may still be moving: watch the car.${isServer || !frame ? '' : savedWords(frame.recording)}`];
}

/**
 * What became of the recording when the link was lost: said only once it is on the disk and in the list.
 * @param {import('./protocol.js').RecordingNow} recording
 */
export function savedWords({ state, saved }) {
  if (state === 'saving') return ' The recording is being saved.';
  return state === 'held' && saved ? ` Recording saved up to ${timeOfDay(saved.until_ms)}.` : '';
}

/** @param {number} count */
function times(count) {
  return count === 1 ? 'once' : count === 2 ? 'twice' : `${count} times`;
}
