// A planned stop: a line under the strip as long as it is in force, and the sheet in which it begins and ends.

import { lineWords, REASONS, sheetWords, titleOf, UNKNOWN } from './planned-stop-layout.js';
import { html, icon, need, setText, setSentence, show } from '../core/dom.js';
import { styled } from '../core/style-sheet.js';
import { addSheet, openSheet } from '../shell/sheet.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('./planned-stop-layout.js').Reason} Reason
 * @typedef {(sentence: string, title?: string) => void} Say
 */

/** The line. @param {HTMLElement} monitor @param {Store} store @param {Say} say */
export function mount(monitor, store, say) {
  void styled('planned-stop');
  const title = html('b');
  const text = html('span', { class: 'small sub' });
  const unknown = html('span', { class: 'small' }, UNKNOWN);
  const end = html('button', { type: 'button', class: 'key', 'data-f': 'planned-stop-end', 'data-operator': '' }, 'End');
  end.setAttribute('aria-label', 'End the planned stop');
  const line = html('section', { class: 'banner planned-stop', 'aria-label': 'Planned stop', 'data-f': 'planned-stop-line' }, icon('clock', 's'), html('span', { role: 'status' }, title, text, unknown), end);
  need(monitor, ':scope > .under').append(line);
  end.addEventListener('click', () => void order(store, say, 'end_planned_stop', {}));
  const draw = () => {
    const stop = (!store.isSilent && store.frame?.session.planned_stop) || null;
    show(line, stop !== null);
    show(end, !store.replaying);
    if (!stop) return;
    setSentence(title, titleOf(stop.reason));
    setSentence(text, lineWords(stop));
    show(unknown, !stop.is_speed_known);
  };
  draw();
  return store.on('draw', draw);
}

/** The sheet. @param {Store} store @param {Say} say */
export function openPlannedStop(store, say) {
  const title = html('h2', { id: 'planned-stop-title' });
  const text = html('p', { class: 'sub', id: 'planned-stop-words' });
  const reasons = html('div', { class: 'pair', role: 'group', 'aria-label': 'Reason' });
  const end = html('button', { type: 'button', class: 'main', 'data-operator': '' }, 'End planned stop');
  const sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-planned-stop', 'aria-labelledby': 'planned-stop-title', 'aria-describedby': 'planned-stop-words' },
    html('div', { class: 'bd' }, title, text), html('div', { class: 'keys' }, reasons, end, html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close'))));
  const act = async (/** @type {'planned_stop' | 'end_planned_stop'} */ kind, /** @type {{reason?: Reason}} */ fields) => {
    sheet.close(); // a refusal is shown beneath it
    await order(store, say, kind, fields);
  };
  reasons.append(...Object.entries(REASONS).map(([reason, label]) => {
    const key = html('button', { type: 'button', class: 'key', 'data-reason': reason, 'data-operator': '' }, label);
    key.addEventListener('click', () => void act('planned_stop', { reason: /** @type {Reason} */ (reason) }));
    return key;
  }));
  end.addEventListener('click', () => void act('end_planned_stop', {}));
  const draw = () => {
    const stop = store.frame?.session.planned_stop ?? null;
    setText(title, stop ? titleOf(stop.reason) : 'Planned stop');
    setSentence(text, sheetWords(stop));
    show(reasons, stop === null);
    show(end, stop !== null);
  };
  const stops = [store.on('draw', draw), addSheet(sheet)];
  sheet.addEventListener('close', () => stops.forEach((stop) => stop()), { once: true });
  draw();
  openSheet(sheet);
}

/** @param {Store} store @param {Say} say @param {'planned_stop' | 'end_planned_stop'} kind @param {{reason?: Reason}} fields */
async function order(store, say, kind, fields) {
  const answer = await store.ask(kind, { vehicle: store.vehicle, ...fields });
  if (!answer.ok) say(answer.reason ?? 'Refused.', kind === 'planned_stop' ? 'Not begun' : 'Not ended');
}
