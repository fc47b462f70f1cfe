// The top bar: the chain with its word and age, the recorder, who is in control.

import { drawChain } from './chain.js';
import { field, setAttribute, setText, setWords } from './dom.js';
import { age, duration } from './words.js';

/**
 * What stands beside the recording dot.
 * @param {{state: string, for_s: number | null}} recording
 * @param {boolean} isLive
 */
export function recordingWords({ state, for_s }, isLive) {
  if (state === 'off') return { isOn: false, text: 'off' };
  if (!isLive || state === 'held') return { isOn: false, text: 'held' };
  return { isOn: true, text: duration(for_s ?? 0, true) };
}

/**
 * @param {HTMLElement} root
 * @param {import('./store.js').Store} store
 */
export function mount(root, store) {
  const chain = field(root, 'small-chain');
  const [link, word, wordAge, rec, recFor, who] = ['link', 'word', 'word-age', 'rec', 'rec-for', 'who-name'].map((name) => field(root, name));
  if (!link || !word || !wordAge || !rec || !recFor || !who) throw new Error('The template lacks the top bar');

  function draw() {
    const view = store.chain;
    drawChain(chain, view);
    setText(word, view.word);
    const since = view.age_s === null ? '' : ` ${age(view.age_s)} s`;
    setWords(wordAge, since.trim());
    setAttribute(link, 'aria-label', `${view.word}${since}: the link to the car. ${view.sentence}`); // begins with what is seen
    const { frame } = store;
    if (!frame) return;
    const recording = recordingWords(frame.recording, view.word === 'Live');
    setAttribute(rec, 'data-on', recording.isOn);
    setWords(recFor, recording.text);
    setText(who, frame.control.holder ?? 'No one');
  }

  draw();
  return store.on('draw', draw);
}
