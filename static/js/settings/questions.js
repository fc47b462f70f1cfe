// The questions to the operator in control: a card under the strip until it is answered or put off, then a line that stays.
// It stands in the flow of the page, so that it covers neither a value nor an alarm nor the slow-down.

import { html, icon, need, setAttribute, setSentence, show } from '../core/dom.js';
import { Meant } from '../core/meant.js';
import { styled } from '../core/style-sheet.js';
import { dealt, keyOf, mayAnswer, placeOf, meanwhileWords, waitingWords } from './question-layout.js';

const STORED = 'catgraph.later';
/** So many put-off questions are remembered. */
const MOST_STORED = 30;

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('./question-layout.js').Question} Question
 */

/**
 * @param {HTMLElement} monitor
 * @param {Store} store
 * @param {(sentence: string, title?: string) => void} say
 */
export async function mount(monitor, store, say) {
  await styled('sources');
  const questions = new Questions(monitor, store, say);
  questions.draw();
  return store.on('draw', () => questions.draw());
}

class Questions {
  #later = new Set(recalled());
  #shown = '';

  /** @param {HTMLElement} monitor @param {Store} store @param {(sentence: string, title?: string) => void} say */
  constructor(monitor, store, say) {
    this.store = store;
    this.say = say;
    this.title = html('b', { 'data-f': 'question-title' });
    this.more = html('span', { 'data-f': 'question-more' });
    this.choose = html('button', { type: 'button', class: 'key solid', 'data-f': 'question-open' }, 'Choose');
    this.later = html('button', { type: 'button', class: 'key', 'data-f': 'question-later' }, 'Later');
    this.card = html('div', { class: 'card', role: 'group', 'aria-label': 'Question', hidden: true }, icon('unknown', 'l'), html('div', { class: 'tx', role: 'status' }, this.title, this.more), html('div', { class: 'ac' }, this.later, this.choose));
    this.lineWords = html('span');
    this.line = html('button', { type: 'button', class: 'waiting', 'aria-haspopup': 'dialog', 'data-f': 'question-waiting', hidden: true }, icon('unknown', 's'), this.lineWords, icon('next', 's'));
    this.others = html('p', { class: 'others', role: 'status', 'data-f': 'question-others', hidden: true });
    this.element = html('section', { class: 'questions', 'aria-label': 'Questions' }, this.card, this.line, this.others);
    this.meant = new Meant(this.card);
    need(monitor, ':scope > .under').append(this.element);
    this.choose.addEventListener('click', (event) => this.meant.by(event) && void this.#open(this.#now().open[0]));
    this.later.addEventListener('click', (event) => this.meant.by(event) && this.#putOff(this.#now().open[0]));
    this.line.addEventListener('click', () => void this.#open(this.#now().waiting[0]));
  }

  #now() {
    const { store } = this;
    const questions = store.isSilent ? [] : (store.frame?.questions ?? []);
    return { questions, ...dealt(placeOf(store), questions, this.#later) };
  }

  draw() {
    const { store } = this;
    const { questions, open, waiting } = this.#now();
    const may = mayAnswer(store);
    const [first] = open;
    show(this.card, may && first !== undefined);
    show(this.line, may && waiting.length > 0);
    show(this.others, !may && questions.length > 0);
    const label = (/** @type {string} */ signal) => store.signal(signal)?.label ?? signal;
    if (may && first) {
      const key = keyOf(placeOf(store), first);
      if (key !== this.#shown) this.meant.moved();
      this.#shown = key;
      setSentence(this.title, first.words);
      setSentence(this.more, `${meanwhileWords(first, label(first.signal))}${open.length > 1 ? ` ${open.length} questions.` : ''}`);
    } else this.#shown = '';
    if (may) setSentence(this.lineWords, waitingWords(waiting, label));
    else setSentence(this.others, `${questions.map(({ words }) => words).join(' ')} The operator in control answers.`);
    setAttribute(document.documentElement, 'data-prompt', may && first !== undefined);
  }

  /** @param {Question | undefined} question */
  #putOff(question) {
    if (!question) return;
    this.#later.add(keyOf(placeOf(this.store), question));
    remember([...this.#later].slice(-MOST_STORED));
    this.draw();
  }

  /** If it comes again one day, it is shown with a card. @param {Question} question */
  #answered(question) {
    if (this.#later.delete(keyOf(placeOf(this.store), question))) remember([...this.#later]);
  }

  /** @param {Question | undefined} question */
  async #open(question) {
    if (!question) return;
    const { open, questions } = this.#now();
    const next = questions[(questions.indexOf(question) + 1) % questions.length];
    try {
      (await import('./question-sheet.js')).openQuestion(this.store, question, {
        say: this.say,
        later: open.includes(question) ? () => this.#putOff(question) : null,
        next: next === question ? null : () => void this.#open(this.#same(next)),
        answered: () => this.#answered(question),
      });
    } catch {
      this.say('The question could not be loaded from the server. Try again.', 'Not opened');
    }
  }

  /** The same question of the newest frame. @param {Question | undefined} question */
  #same(question) {
    const place = placeOf(this.store);
    return question && this.#now().questions.find((one) => keyOf(place, one) === keyOf(place, question));
  }
}

/** @returns {string[]} */
function recalled() {
  try {
    const kept = JSON.parse(localStorage.getItem(STORED) ?? '[]');
    return Array.isArray(kept) ? kept.filter((one) => typeof one === 'string').slice(-MOST_STORED) : [];
  } catch {
    return [];
  }
}

/** @param {string[]} keys */
function remember(keys) {
  try {
    localStorage.setItem(STORED, JSON.stringify(keys));
  } catch {
    // without storage it is shown again when the page is opened again
  }
}
