// One dialog at a time: which, and what stands in it. Alarms and broken links open by themselves and close by themselves.

import { isAboutLink, layOut, titleOf } from '../alarms/alarm-layout.js';
import { drawBigChain } from './chain.js';
import { field, html, listen, need, setAttribute, setIcon, setText, setSentence, show, textNodes } from '../core/dom.js';
import { areAlarmsInSight } from './layout.js';
import { Meant } from '../core/meant.js';
import { isAsked } from './sheet.js';
import { shownIn } from '../core/units.js';
import { unseenOf, unseenWords } from '../core/unseen.js';
import { thenWords } from './veil.js';
import { dialogWords } from '../alarms/standing.js';
import { keysOf, silentWords } from '../alarms/alarms-layout.js';
import { age, counted, fixed, timeOfDay } from '../core/format.js';

/** A silent server is covered by the veil at once; the dialog waits for what a change of radio cell takes [s]. */
const LOST_AFTER_S = 4;

/**
 * @typedef {import('../core/protocol-types.js').StandingAlarm} Alarm
 * @typedef {import('../core/protocol-types.js').State} State
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
  if (frame.replay && !isSilent) return null; // its alarms are past; alarms of the live car come through replay.js
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
 * @param {import('../core/store.js').Store} store
 * @param {import('./router.js').Router} router
 */
export function mount(store, router) {
  const dialogs = new Dialogs(store, router);
  const { alarm, lost, mute, failed } = dialogs.sheets;
  const keys = /** @type {[HTMLElement, string, () => void][]} */ ([
    [alarm, 'acknowledge', () => void dialogs.answer()],
    [alarm, 'silence', () => void dialogs.silence()],
    [lost, 'retry', () => (store.chain.cut === 2 ? router.reconnect() : router.retry())],
    [lost, 'change', () => router.choose()],
    [lost, 'exit', () => router.exit()],
    [mute, 'retry', () => router.reconnect()],
    [mute, 'exit', () => router.exit()],
    [failed, 'retry', () => router.retry()],
    [failed, 'change', () => router.choose()],
  ]);
  const stops = [
    store.on('draw', () => dialogs.draw()),
    store.on('tick', () => document.hidden && dialogs.judge()),
    ...Object.values(dialogs.sheets).flatMap((sheet) => [
      // Escape and the phone's back key mean: I have seen it.
      listen(sheet, 'cancel', (event) => {
        event.preventDefault();
        if (dialogs.meant(sheet).by(event)) void dialogs.answer();
      }),
      listen(sheet, 'close', (event) => dialogs.closed(sheet, event)),
    ]),
    ...keys.map(([sheet, name, act]) => listen(field(sheet, name), 'click', (event) => dialogs.meant(sheet).by(event) && act())),
  ];
  if (store.frame) dialogs.draw();
  return () => stops.forEach((stop) => stop());
}

class Dialogs {
  sheets = /** @type {Record<Dialog['kind'], HTMLDialogElement>} */ (Object.fromEntries(
    ['alarm', 'lost', 'mute', 'failed'].map((kind) => [kind, need(document, `#sheet-${kind}`)])));
  /** @type {Dialog | null} */
  #standing = null;
  /** @type {Map<HTMLElement, Meant>} */
  #meant = new Map();
  /** The alarm that the dialog shows, by its key. */
  #shown = '';

  /** @param {import('../core/store.js').Store} store @param {import('./router.js').Router} router */
  constructor(store, router) {
    this.store = store;
    this.router = router;
  }

  /** Whether a press was meant for what this dialog shows now. @param {HTMLElement} sheet @returns {Meant} */
  meant(sheet) {
    const had = this.#meant.get(sheet);
    if (had) return had;
    const meant = new Meant(sheet);
    this.#meant.set(sheet, meant);
    return meant;
  }

  /** Acknowledges what the open dialog shows. */
  async answer() {
    if (!this.#standing) return;
    const { router, store } = this;
    const { kind, alarm } = this.#standing;
    if (kind !== 'alarm') router.answered = lossKey(store.frame, store.isSilent);
    if (alarm && store.isViewer) router.closeHere(alarm);
    else if (alarm) {
      const reply = await store.ask('acknowledge', { alarm: alarm.id, occurrence: alarm.occurrence });
      if (!reply.ok && kind === 'alarm') router.say(reply.reason ?? 'Refused.', 'Not acknowledged');
    }
    this.draw();
  }

  /** No sound for a while: the alarm stays, and waits. */
  async silence() {
    const { store } = this;
    if (this.#standing?.kind !== 'alarm') return;
    const { id, occurrence } = this.#standing.alarm;
    const reply = await store.ask('silence', { alarm: id, occurrence });
    if (!reply.ok) this.router.say(reply.reason ?? 'Refused.', 'Not silenced');
  }

  /** Some browsers close a dialog without `cancel`; what is not acknowledged opens again with the next frame. @param {HTMLDialogElement} sheet @param {Event} event */
  closed(sheet, event) {
    if (!sheet.isConnected || sheet.open) return; // removed by a page that gave up, or moved to another place: nobody acknowledged it
    if (this.#standing && this.sheets[this.#standing.kind] === sheet && this.meant(sheet).by(event) && !this.store.painter.drawing.isFailed) void this.answer();
  }

  judge() {
    const { router, store } = this;
    const key = lossKey(store.frame, store.isSilent);
    if (router.answered !== null && router.answered !== key && key === 'none') router.answered = null;
    this.#standing = store.painter.drawing.isFailed ? null : dialogOf({ // then undrawn.js names the alarms
      frame: router.unclosed(store.frame), isSilent: store.isSilent, silence_s: store.silence_s,
      isChoosing: router.isChoosing, isAnswered: router.answered === key,
    });
    return this.#standing;
  }

  draw() {
    const standing = this.judge();
    const wanted = standing ? this.sheets[standing.kind] : null;
    setAttribute(document.body, 'data-asking', standing?.kind === 'alarm' && standing.alarm.priority === 'critical');
    const place = standing ? placeOf(standing.kind) : document.body;
    setAttribute(document.body, 'data-held', standing !== null && place === document.body); // what stands under it takes no press
    if (wanted?.open && wanted.parentElement !== place) wanted.close(); // the window has another size now
    if (wanted && (!wanted.open || wanted.matches(':modal'))) { // a sheet that was being loaded may lie over it
      for (const sheet of /** @type {NodeListOf<HTMLDialogElement>} */ (document.querySelectorAll('dialog[open]'))) {
        if (isAsked(sheet)) sheet.close();
      }
    }
    for (const sheet of Object.values(this.sheets)) if (sheet !== wanted && sheet.open) sheet.close();
    if (!standing || !wanted) return;
    if (standing.kind === 'alarm') {
      fillAlarm(wanted, standing.alarm, { isPane: place !== document.body, mayAct: !this.store.isViewer });
      setAttribute(wanted, 'data-named', layOut(this.store.frame?.alarms ?? []).worst === standing.alarm); // by the strip
    }
    else fillLink(wanted, standing.kind, this.store);
    if (standing.kind === 'lost') setText(field(wanted, 'title'), standing.alarm?.title ?? 'Connection lost');
    if (standing.kind === 'failed') setSentence(field(wanted, 'change'), this.router.suggestion ? `Use ${this.router.suggestion}` : 'Change the address');
    const key = standing.kind === 'alarm' ? headKey(standing.alarm) : standing.kind;
    if (!wanted.open || key !== this.#shown) this.meant(wanted).moved();
    this.#shown = key;
    if (!wanted.open) raise(wanted, place);
  }
}

/**
 * Where a dialog stands: in its pane, where it covers nothing that is to be seen, or over the page.
 * @param {Dialog['kind']} kind
 * @returns {HTMLElement}
 */
function placeOf(kind) {
  if (kind === 'failed' || !areAlarmsInSight()) return document.body;
  return need(document, `#monitor [data-slot="${kind === 'alarm' ? 'alarm' : 'link'}"]`);
}

/** Which alarm of which occurrence. @param {Pick<Alarm, 'id' | 'occurrence'>} alarm */
export function headKey({ id, occurrence }) {
  return `${id} ${occurrence}`;
}

/** The alarm that stands in the head of its pane, as headKey names it; null: none does. @param {HTMLElement} monitor */
export function alarmInHead(monitor) {
  return /** @type {HTMLElement | null} */ (monitor.querySelector('[data-slot="alarm"] > [open]'))?.dataset['alarm'] ?? null;
}

/**
 * In its pane it takes no focus: a person who types a number there must not acknowledge by the next key.
 * @param {HTMLDialogElement} sheet
 * @param {HTMLElement} place
 */
function raise(sheet, place) {
  if (sheet.parentElement !== place) place.append(sheet);
  if (place === document.body) {
    sheet.showModal();
    need(sheet, 'button').focus();
  } else sheet.setAttribute('open', '');
}

/**
 * @param {HTMLElement} sheet
 * @param {Alarm} alarm
 * @param {{isPane: boolean, mayAct: boolean}} where isPane: at the top of the list of alarms, in place of its row
 */
function fillAlarm(sheet, alarm, { isPane, mayAct }) {
  sheet.dataset['alarm'] = headKey(alarm);
  for (const name of /** @type {const} */ (['acknowledge', 'silence'])) setAttribute(field(sheet, name), 'aria-label', `${name === 'silence' ? 'Silence' : 'Acknowledge'}: ${alarm.title}`);
  show(field(sheet, 'silence'), isPane && mayAct && keysOf(alarm).includes('silence'));
  sheet.dataset['priority'] = alarm.priority;
  setIcon(need(sheet, 'h2 .i'), alarm.priority === 'critical' ? 'crit' : 'warn');
  setAttribute(sheet, 'data-ended', !alarm.active);
  setText(field(sheet, 'title'), titleOf(alarm));
  const { measured, limit } = alarm;
  show(field(sheet, 'versus'), measured !== null && limit !== null);
  if (measured && limit) {
    for (const [name, quantity] of /** @type {const} */ ([['measured', measured], ['limit', limit]])) {
      const { value, unit } = shownIn(quantity.value, quantity.unit);
      setText(field(sheet, name), fixed(value));
      setText(field(sheet, `${name}-unit`), unit);
    }
  }
  setSentence(field(sheet, 'text'), [dialogWords(alarm), isPane ? silentWords(alarm) : ''].filter(Boolean).join(' '));
}

/**
 * @param {HTMLElement} sheet
 * @param {'lost' | 'mute' | 'failed'} kind
 * @param {import('../core/store.js').Store} store
 */
function fillLink(sheet, kind, store) {
  const view = store.chain;
  drawBigChain(field(sheet, 'chain'), view);
  const [bold, plain, more] = linkWords(kind, view, store.frame);
  const text = field(sheet, 'words');
  const key = `${bold}|${plain}`;
  if (text.dataset['shown'] !== key) {
    text.replaceChildren(html('b', {}, ...textNodes(bold)), ' ', ...textNodes(plain));
    text.dataset['shown'] = key;
  }
  setSentence(field(sheet, 'more'), kind === 'lost' ? more + lastKnown(store) : more);
}

/**
 * What was last known of the car, as a further sentence; none of a recording's values, which are no car's of now.
 * @param {import('../core/store.js').Store} store
 */
export function lastKnown(store) {
  const { frame } = store;
  const then = frame && !frame.replay ? thenWords(frame) : '';
  return then ? ` Last known: ${[then, unseenWords(unseenOf(store))].filter(Boolean).join(', ')}.` : '';
}

/**
 * One bold sentence of what fell silent, what is known, and what to do.
 * @param {'lost' | 'mute' | 'failed'} kind
 * @param {import('../core/link.js').ChainView} view
 * @param {State | null} frame
 * @returns {[string, string, string]}
 */
export function linkWords(kind, view, frame) {
  const link = frame?.link;
  const tried = link && link.attempts > 0 ? `Tried ${times(link.attempts)} in ${age(link.trying_for_s)} s.` : '';
  if (kind === 'failed') return [view.sentence, '', [link?.problem?.hint, tried].filter(Boolean).join(' ')];
  if (kind === 'mute') {
    const received = link ? `${link.topics_heard} of ${link.topics_subscribed} topics sent data.` : '';
    return [view.sentence, received, view.detail];
  }
  const isOld = view.cut === 0 || view.isUnserved; // the frame's data is of then
  const again = view.cut !== 1 || view.isUnserved ? view.detail : `The server is running and dials again${link?.attempts ? `; ${counted(link.attempts, 'try', 'tries')} so far` : ''}.`;
  return [view.sentence, again, `The car may still be moving: watch the car.${isOld || !frame ? '' : savedWords(frame.recording)}`];
}

/**
 * What became of the recording when the link was lost: stated only once it is on the disk and in the list.
 * @param {import('../core/protocol-types.js').RecordingState} recording
 */
export function savedWords({ state, saved }) {
  if (state === 'saving') return ' The recording is being saved.';
  return state === 'held' && saved ? ` Recording saved up to ${timeOfDay(saved.until_ms)}.` : '';
}

/** @param {number} count */
function times(count) {
  return count === 1 ? 'once' : count === 2 ? 'twice' : `${count} times`;
}
