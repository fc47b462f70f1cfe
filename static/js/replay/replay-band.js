// The one band of a replay: what is shown and when it was, the alarm of that moment, and what is live meanwhile.

import { html, icon, setAttribute, setIcon, setText, setSentence, show } from '../core/dom.js';
import { timeOfDay } from '../core/format.js';
import { asideOf, countWords, dateOf, liveWords, momentOf } from './replay-layout.js';

export class ReplayBand {
  #files = icon('files', 's');
  #what = html('b', { class: 'text' });
  #time = html('span', { class: 'n end' });
  #mark = icon('clock', 's');
  #text = html('span', { class: 'text' }, 'Opening…');
  #end = html('span', { class: 'end' });
  #count = html('b', { class: 'count' });
  #calm = html('p', { class: 'replay-calm' });
  #liveText = html('b', { class: 'text' });
  #recording = html('span', { class: 'recording' });
  /** Opens the list of alarms. */
  moment = html('button', { type: 'button', class: 'replay-line', 'aria-haspopup': 'dialog', disabled: true }, html('span', { class: 'body' }, this.#mark, this.#text, this.#end), this.#count, icon('next', 's'));
  /** Leads back to the live car, where it needs the operator. */
  live = html('button', { type: 'button', class: 'replay-live', hidden: true }, icon('bell', 's'), this.#liveText, this.#recording, html('span', { class: 'end' }, 'Back to live'));
  element = html('section', { class: 'replay-band', 'aria-label': 'Replay of a recording' },
    html('div', { class: 'replay-date' }, this.#files, this.#what, this.#time), this.moment, this.#calm, this.live);

  /** While it is being opened. @param {import('../core/protocol-types.js').Recording} row */
  sketch(row) {
    setSentence(this.#what, whatWords(row.started_ms, row.title || row.vehicle));
    setText(this.#time, timeOfDay(row.started_ms));
  }

  /**
   * @param {import('../core/protocol-types.js').State} frame a replay's
   * @param {import('../core/protocol-types.js').Timeline | null} line as far as it is made
   */
  draw(frame, line) {
    const { replay } = frame;
    if (!replay) return;
    setSentence(this.#what, whatWords(replay.at_ms, replay.title || replay.vehicle));
    setAttribute(this.moment, 'disabled', null);
    setText(this.#time, timeOfDay(replay.at_ms));
    const { kind, icon: mark, text, end } = momentOf(frame);
    setAttribute(this.moment, 'data-kind', kind || null);
    setIcon(this.#mark, mark);
    setSentence(this.#text, text);
    setSentence(this.#end, end);
    setSentence(this.#count, countWords(line));
  }

  /** What is live: in a line, or as a key where it needs the operator. @param {import('../core/protocol-types.js').LiveSummary | null | undefined} live */
  drawLive(live) {
    const aside = asideOf(live);
    const { text, recording } = liveWords(live);
    show(this.live, aside !== null);
    show(this.#calm, aside === null);
    setSentence(this.#calm, `Live now: ${recording}, ${text}`);
    if (!aside) return null;
    setAttribute(this.live, 'data-kind', aside.kind);
    setSentence(this.#liveText, aside.text);
    setSentence(this.#recording, recording);
    return aside.asking;
  }
}

/** "Recorded 19 Nov 2026, Ocelot". @param {number} at_ms @param {string} name */
function whatWords(at_ms, name) {
  return `Recorded ${dateOf(at_ms)}, ${name}`;
}

/** The dialog of a live alarm that nobody has acknowledged. */
export function liveSheet() {
  return /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet crit', id: 'sheet-live', role: 'alertdialog', 'aria-labelledby': 'live-title', 'aria-describedby': 'live-words', 'data-priority': 'critical' },
    html('h2', {}, icon('crit'), html('span', { id: 'live-title', 'data-f': 'title' })),
    html('div', { class: 'bd', id: 'live-words' }, html('p', { 'data-f': 'text' }), html('p', { class: 'sub' }, 'This is live. The page behind it shows a recording.')),
    html('div', { class: 'keys' }, html('button', { type: 'button', class: 'main', 'data-f': 'back' }, 'Back to live'), html('button', { type: 'button', class: 'key', 'data-f': 'stay' }, 'Stay in the replay'))));
}
