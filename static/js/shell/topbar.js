// The top bar: the chain with its state and age, the recorder and its key in the menu. Which car, and who is in control: cars.js, control.js.

import { drawChain } from './chain.js';
import { field, listen, need, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { closeSheet } from './sheet.js';
import { age, duration, timeOfDay } from '../core/format.js';
import { write } from '../core/ink.js';
import { speedUnit, speedWords } from '../core/units.js';

/**
 * What stands beside the recording dot, and what the menu's key orders: to record, to end it, or nothing now.
 * @param {import('../core/protocol-types.js').RecordingState} recording
 * @param {boolean} isSilent the server is, so that nobody knows whether it records
 */
export function recordingWords({ state, for_s, reason }, isSilent) {
  if (isSilent) return { isOn: false, text: '?', title: 'The server does not answer: the recording state is unknown.', order: null };
  const title = `Recording ${state === 'recording' ? 'now' : state}.${reason ? ` ${reason}` : ''}`;
  if (state === 'off') return { isOn: false, text: 'off', title, order: true };
  if (state === 'stopped') return { isOn: false, text: 'fault', title, order: true };
  if (state === 'saving') return { isOn: false, text: 'saving', title, order: null };
  if (state === 'held') return { isOn: false, text: 'held', title, order: false };
  const whole_s = for_s ?? 0;
  const text = whole_s < 3600 ? duration(whole_s, true) : `${duration(whole_s).slice(0, -3)} h`;
  return { isOn: true, text, title, order: false };
}

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @param {(sentence: string, title?: string) => void} say
 */
export function mount(root, store, say) {
  const menu = /** @type {HTMLDialogElement} */ (need(document, '#sheet-menu'));
  const [key, keyWords] = [field(menu, 'record'), field(menu, 'record-words')];
  /** @type {boolean | null} */
  let order = null;
  const chain = field(root, 'small-chain');
  const [link, state, linkAge, rec, recFor] = ['link', 'link-state', 'link-age', 'rec', 'rec-for'].map((name) => field(root, name));
  const [clock, speed, speedU] = ['clock', 'bar-speed', 'bar-speed-unit'].map((name) => field(root, name));
  if (!link || !state || !linkAge || !rec || !recFor || !clock || !speed || !speedU) throw new Error('The template lacks the top bar');

  function draw() {
    const view = store.chain;
    drawChain(chain, view);
    const name = view.state === 'Live' && view.isWeak ? 'Weak' : view.state; // a narrow bar has no place for more
    setText(state, name);
    const since = view.age_s === null ? '' : ` ${age(view.age_s)} s`;
    setSentence(linkAge, since.trim());
    setAttribute(link, 'aria-label', `${name}${since}: the link to the car. ${view.sentence}${view.isWeak ? ` ${view.detail}` : ''}`); // begins with what is seen
    setText(clock, timeOfDay(Date.now()));
    const speed_mps = store.signal('speed')?.value?.speed_mps;
    const isKnown = typeof speed_mps === 'number';
    write(speed, store.ink('speed').ink, isKnown ? speedWords(speed_mps)[0] ?? '–' : '–', speedU, isKnown ? speedUnit() : '');
    const { frame } = store;
    if (!frame) return;
    const recording = recordingWords((store.heeded ?? frame).recording, store.isSilent); // of the car now, whatever is replayed
    setAttribute(rec, 'data-on', recording.isOn);
    setAttribute(rec, 'title', recording.title);
    setSentence(recFor, recording.text);
    order = frame.replay || !store.isMonitoring ? null : recording.order;
    show(key, order !== null);
    setText(keyWords, order === false ? 'End the recording' : 'Start recording');
  }

  function press() {
    closeSheet(menu);
    const on = order;
    if (on !== null) import('./record-key.js').then(({ record }) => record(on, store, say)).catch(() => say('It could not be loaded from the server. Try again.', 'Nothing was changed'));
  }

  if (store.frame) draw(); // before the first frame it is not shown
  const stops = [store.on('draw', draw), listen(key, 'click', press)];
  return () => stops.forEach((stop) => stop());
}
