// The top bar: the chain with its word and age, the recorder and its key in the menu. Who is in control: control.js.

import { drawChain } from './chain.js';
import { field, listen, need, setAttribute, setText, setWords, show } from './dom.js';
import { closeSheet } from './sheet.js';
import { age, duration } from './words.js';

/**
 * What stands beside the recording dot, and what the menu's key orders: to record, to end it, or nothing now.
 * @param {import('./protocol.js').RecordingNow} recording
 * @param {boolean} isSilent the server is, so that nobody knows whether it records
 */
export function recordingWords({ state, for_s, reason }, isSilent) {
  if (isSilent) return { isOn: false, text: '?', title: 'The server does not answer: it is unknown whether it records.', order: null };
  const title = `Recording ${state === 'recording' ? 'now' : state}.${reason ? ` ${reason}` : ''}`;
  if (state === 'off') return { isOn: false, text: 'off', title, order: true };
  if (state === 'stopped') return { isOn: false, text: 'fault', title, order: true };
  if (state === 'saving') return { isOn: false, text: 'saving', title, order: null };
  if (state === 'held') return { isOn: false, text: 'held', title, order: false };
  return { isOn: true, text: duration(for_s ?? 0, true), title, order: false };
}

/**
 * @param {HTMLElement} root
 * @param {import('./store.js').Store} store
 * @param {(sentence: string, title?: string) => void} say
 */
export function mount(root, store, say) {
  const menu = /** @type {HTMLDialogElement} */ (need(document, '#sheet-menu'));
  const [key, keyWords] = [field(menu, 'record'), field(menu, 'record-words')];
  /** @type {boolean | null} */
  let order = null;
  const chain = field(root, 'small-chain');
  const [link, word, wordAge, rec, recFor] = ['link', 'word', 'word-age', 'rec', 'rec-for'].map((name) => field(root, name));
  if (!link || !word || !wordAge || !rec || !recFor) throw new Error('The template lacks the top bar');

  function draw() {
    const view = store.chain;
    drawChain(chain, view);
    setText(word, view.word);
    const since = view.age_s === null ? '' : ` ${age(view.age_s)} s`;
    setWords(wordAge, since.trim());
    setAttribute(link, 'aria-label', `${view.word}${since}: the link to the car. ${view.sentence}`); // begins with what is seen
    const { frame } = store;
    if (!frame) return;
    const recording = recordingWords((store.heeded ?? frame).recording, store.isSilent); // of the car now, whatever is replayed
    setAttribute(rec, 'data-on', recording.isOn);
    setAttribute(rec, 'title', recording.title);
    setWords(recFor, recording.text);
    order = frame.replay || !store.isMonitoring ? null : recording.order;
    show(key, order !== null);
    setText(keyWords, order === false ? 'End the recording' : 'Start recording');
  }

  async function obey() {
    closeSheet(menu);
    const answer = await store.ask('record', { on: order });
    if (!answer.ok) say(answer.reason ?? 'Refused.', order ? 'Not recording' : 'The recording goes on');
  }

  if (store.frame) draw(); // before the first frame it is not shown
  const stops = [store.on('draw', draw), listen(key, 'click', obey)];
  return () => stops.forEach((stop) => stop());
}
