// The sheet in which another topic is picked for a signal: those of the car whose type can be read as it, or the server's own choice.

import { field, html, icon, need, setText, setSentence, show } from '../core/dom.js';
import { closeSheet, openSheet } from '../shell/sheet.js';
import { counted } from '../core/format.js';

/**
 * @typedef {import('./settings-model.js').Candidate} Candidate
 * @typedef {{topic: string | null, title: string, detail: string, isChosen: boolean}} Option
 */

/**
 * What can be picked for a signal.
 * @param {Candidate[] | null} candidates null: the bridge does not say what the car has
 * @param {string | null} now the topic that carries the signal
 * @param {string | undefined} picked by the operator
 * @returns {Option[]}
 */
export function optionsOf(candidates, now, picked) {
  const gone = picked !== undefined && !candidates?.some(({ topic }) => topic === picked);
  return [
    { topic: null, title: 'Choose automatically', detail: picked === undefined ? (now ? `now ${now}` : 'no match now') : 'by type, publisher, namespace, frame and name', isChosen: picked === undefined },
    ...(gone ? [{ topic: picked, title: picked, detail: candidates ? 'chosen, but not published with a matching type' : 'picked', isChosen: true }] : []),
    ...(candidates ?? []).map((one) => ({ topic: one.topic, title: one.topic, detail: detailOf(one, one.topic === now), isChosen: one.topic === picked })),
  ];
}

/** Type, frame and what speaks for a candidate. @param {Candidate} candidate @param {boolean} isNow it carries the signal now */
function detailOf({ type, frame, why }, isNow) {
  return [type, isNow ? 'now' : '', frame ? `frame ${frame}` : '', why ?? ''].filter(Boolean).join(' · ');
}

/**
 * @param {import('../core/store.js').Store} store
 * @param {import('./settings-model.js').SettingsModel} model
 * @param {string} signal
 */
export async function openTopicPicker(store, model, signal) {
  const sheet = /** @type {HTMLDialogElement} */ (need(document, '#sheet-topic'));
  const label = store.signal(signal)?.label ?? signal;
  const list = field(sheet, 'list');
  setText(field(sheet, 'title'), `Topic of ${label}`);
  setSentence(field(sheet, 'words'), 'Loading the car’s topics…');
  setSentence(field(sheet, 'refused'), '');
  sheet.dataset['signal'] = signal;
  list.replaceChildren();
  openSheet(sheet);
  /** @type {Candidate[] | null} */
  let candidates = null;
  let text;
  try {
    if (!model.body && !store.replaying) await model.load();
    const known = (await model.candidates()).candidates;
    candidates = known?.[signal] ?? null;
    text = candidates === null ? 'The bridge does not list the car’s topics.' : candidates.length
      ? `${counted(candidates.length, 'topic')} of the car match this signal.` : 'No topic of the car has a type that matches this signal.';
  } catch {
    text = 'The topics could not be loaded: the server does not answer.';
  }
  if (sheet.dataset['signal'] !== signal) return; // another signal was requested meanwhile
  setSentence(field(sheet, 'words'), text);
  const options = optionsOf(candidates, store.signal(signal)?.topic ?? null, model.chosen.topics[signal]);
  list.replaceChildren(...options.map((option) => html('li', {}, key(option))));

  /** @param {Option} option */
  function key({ topic, title, detail, isChosen }) {
    const mark = icon('ok');
    show(mark, isChosen);
    const button = html('button', { type: 'button', 'aria-pressed': String(isChosen) }, html('span', { class: 'tx' }, html('b', {}, title), html('small', {}, detail)), mark);
    button.addEventListener('click', async () => {
      setSentence(field(sheet, 'refused'), '');
      const outcome = await model.set({ topics: { [signal]: topic } });
      if (outcome.ok) closeSheet(sheet);
      else setSentence(field(sheet, 'refused'), `Not changed. ${outcome.reason}`);
    });
    return button;
  }
}
