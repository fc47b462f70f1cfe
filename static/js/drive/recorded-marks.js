// The marks of a recording: fetched once, listed in its sheet, and shown as a card at their moment of a replay.

import { PlayKey } from './play-key.js';
import { PhotoView } from './photo-view.js';
import { categoryWords } from './mark-model.js';
import { shape } from './drive-parts.js';
import { styled } from '../core/style-sheet.js';
import { request } from '../control/request.js';
import { keptAt } from '../core/kept-at.js';
import { html, icon, listen, setSentence, show, textNodes } from '../core/dom.js';
import { duration } from '../core/format.js';
import { addressOf } from '../files/files-model.js';

/** A mark's card stands from so long before it to so long after [s]. */
const BEFORE_S = 0.5;
const AFTER_S = 10;

/**
 * @typedef {import('./mark-list.js').Stored & {at_s: number}} Recorded
 * @typedef {(sentence: string, title?: string) => void} Say
 */

/** The marks of a recording in the order of time; none where they cannot be had. @param {string} id @returns {Promise<Recorded[]>} */
export async function marksOf(id) {
  const { marks } = await request(addressOf(id, '/marks'));
  return Array.isArray(marks) ? marks.filter(({ at_s }) => Number.isFinite(at_s)).sort((a, b) => a.at_s - b.at_s) : [];
}

/** @param {string} id @param {string} mark @param {'voice' | 'photo'} part */
const partAt = (id, mark, part) => keptAt(addressOf(id, `/marks/${encodeURIComponent(mark)}/${part}`));

/** "Control · A. K. · came later". @param {Recorded} mark */
export function aboutWords({ category, source, by, late }) {
  return [categoryWords(category), source === 'car' ? 'by the car’s button' : by ?? '', late ? 'delivered after the recording' : ''].filter(Boolean).join(' · ');
}

/** Which mark is shown at a moment: the last one that has begun. @param {Recorded[]} marks @param {number} at_s */
export function markAt(marks, at_s) {
  return marks.findLast((mark) => at_s >= mark.at_s - BEFORE_S && at_s <= mark.at_s + AFTER_S) ?? null;
}

/**
 * The marks of a recording as a list, filled once they are there.
 * @param {string} id
 * @param {Say} say
 * @param {(at_s: number) => void} open shows that moment
 * @returns {Promise<HTMLElement | null>} null: it has none
 */
export async function listOf(id, say, open) {
  const [marks] = await Promise.all([marksOf(id), styled('drive')]);
  if (!marks.length) return null;
  return html('ul', { class: 'file-marks', 'aria-label': 'Marks' }, ...marks.map((mark) => {
    const row = html('button', { type: 'button', class: 'row' }, shape('flag'), html('span', { class: 'n' }, duration(mark.at_s, true)), html('span', { class: 'tx' }, html('bdi', {}, mark.words || 'Mark'), html('span', { class: 'sub' }, ...textNodes(aboutWords(mark)))));
    listen(row, 'click', () => open(Math.max(0, mark.at_s - 2)));
    const item = html('li', {}, row);
    if (mark.voice) {
      const player = new PlayKey(() => partAt(id, mark.mark, 'voice'), say);
      player.draw(null);
      item.append(player.element);
    }
    if (mark.photo) item.append(photoOf(id, mark));
    return item;
  }));
}

/** @param {string} id @param {Recorded} mark */
function photoOf(id, mark) {
  const view = new PhotoView(() => partAt(id, mark.mark, 'photo'));
  view.draw();
  return html('a', { class: 'photo-link', href: partAt(id, mark.mark, 'photo'), target: '_blank', rel: 'noopener', 'aria-label': 'Open the photo of the mark' }, view.element);
}

/** The card of a mark while a replay shows its moment. */
export class MarkCard {
  #shown = '';
  #closed = '';
  /** @type {PlayKey | null} */
  #player = null;
  #title = html('p', { class: 't' });
  #about = html('p', { class: 'm' });
  #parts = html('div', { class: 'card-parts' });
  #close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close' }, icon('close'));
  element = html('section', { class: 'mark-card', 'aria-label': 'Mark', hidden: true }, shape('flag'), html('div', { class: 'tx' }, this.#title, this.#about), this.#close, this.#parts);

  /** @param {string} id of the recording @param {Say} say */
  constructor(id, say) {
    this.id = id;
    this.say = say;
    listen(this.#close, 'click', () => {
      this.#closed = this.#shown;
      show(this.element, false);
      this.#player?.stop();
    });
  }

  /** @param {Recorded[]} marks @param {number} at_s */
  draw(marks, at_s) {
    const mark = markAt(marks, at_s);
    if (!mark) {
      this.#closed = '';
      if (this.#shown) this.stop();
      return;
    }
    if (mark.mark === this.#shown) return;
    this.stop();
    this.#shown = mark.mark;
    if (mark.mark === this.#closed) return;
    setSentence(this.#title, mark.words || `Mark at ${duration(mark.at_s, true)}`);
    setSentence(this.#about, aboutWords(mark));
    if (mark.voice) {
      this.#player = new PlayKey(() => partAt(this.id, mark.mark, 'voice'), this.say);
      this.#player.draw(null);
      this.#parts.append(this.#player.element);
    }
    if (mark.photo) this.#parts.append(photoOf(this.id, mark));
    show(this.element, true);
  }

  stop() {
    this.#player?.stop();
    this.#player = null;
    this.#shown = '';
    this.#parts.replaceChildren();
    show(this.element, false);
  }
}
