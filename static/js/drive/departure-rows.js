// The rows of the departure check: what is done and seen now, what failed, what is open, what is done.

import { barOf, failedWords, fixOf, lineWords, needWords, plain, valueOf } from './departure-layout.js';
import { html, icon, setAttribute, setText, setSentence, show } from '../core/dom.js';

/**
 * @typedef {import('./departure-layout.js').Item} Item
 * @typedef {import('./departure-layout.js').Face} Face
 * @typedef {object} Acts what a row can request
 * @property {(item: Item, event: Event) => void} tick
 * @property {(item: Item) => void} explain opens the reason why it failed or is not applicable
 * @property {(item: Item, does: import('./departure-layout.js').Fix['does'], event: Event) => void} fix
 */

/** A press so long opens the other choices of an item [ms]. */
const LONG_MS = 500;
const MARKS = { manual: 'edit', automatic: 'clock', active: 'slow' };

/** One item; another face is another row. */
export class Row {
  /** @param {Item} item @param {Face} face @param {Acts} acts @param {boolean} isLocked signed, or a viewer's */
  constructor(item, face, acts, isLocked) {
    this.item = item;
    this.face = face;
    this.parts = (face === 'now' ? nowParts : face === 'failed' ? failedParts : plainParts)(item, face, isLocked);
    const { body, element } = this.parts;
    setAttribute(element, 'data-item', item.id);
    setAttribute(element, 'data-face', face);
    if (isLocked) return;
    const { tick, fix } = this.parts;
    tick?.addEventListener('click', (event) => acts.tick(this.item, event));
    fix?.addEventListener('click', (event) => {
      const found = fixOf(this.item);
      if (found) acts.fix(this.item, found.does, event);
    });
    for (const key of [body, this.parts.why]) key?.addEventListener('click', () => acts.explain(this.item));
    onLongPress(element, () => acts.explain(this.item));
  }

  /** @param {Item} item @param {boolean} isNext @param {string} due of one that has an interval */
  draw(item, isNext, due) {
    this.item = item;
    const { parts } = this;
    setAttribute(parts.element, 'data-next', isNext);
    setSentence(parts.line, parts.isNow ? needWords(item) : parts.isFailed ? item.fix : lineWords(item, due));
    if (parts.isFailed) {
      const [title, allowed] = failedWords(item);
      setSentence(parts.title, title);
      setSentence(parts.allowed, allowed);
    } else setText(parts.title, item.title);
    if (parts.isNow) parts.draw(item);
  }
}

/** @param {Item} item @param {Face} face @param {boolean} isLocked */
function plainParts(item, face, isLocked) {
  const title = html('b', { class: 't' });
  const line = html('span', { class: 'm' });
  const mark = icon(face === 'done' ? 'ok' : face === 'not_applicable' ? 'unknown' : MARKS[item.group], face === 'not_applicable' ? 'dashed' : '');
  const body = html(isLocked ? 'div' : 'button', { class: 'dep-body', ...(isLocked ? {} : { type: 'button', 'aria-haspopup': 'dialog' }) }, mark, title, line);
  const isTicked = face === 'done';
  const tick = item.group === 'manual' && face !== 'not_applicable' && !(isLocked && isTicked)
    ? html('button', { type: 'button', class: 'tick', 'aria-pressed': String(isTicked), 'aria-label': `Done: ${item.title}`, 'aria-disabled': isLocked || null }, ...(isTicked ? [icon('ok')] : [])) : null;
  const tag = item.group !== 'manual' && face === 'open' ? html('span', { class: 'waits' }, 'waits') : null;
  const element = html('li', { class: 'dep-row' }, body, ...(tick ? [tick] : tag ? [tag] : []));
  return { element, body, title, line, tick, fix: null, why: null, isNow: /** @type {const} */ (false), isFailed: /** @type {const} */ (false) };
}

/** @param {Item} item @param {Face} _ @param {boolean} isLocked */
function failedParts(item, _, isLocked) {
  const title = html('b', { class: 't' });
  const allowed = html('span', { class: 'end' });
  const line = html('p', { class: 'm' });
  const found = fixOf(item);
  const fix = found && !isLocked ? html('button', { type: 'button', class: 'key', 'data-does': found.does }, found.label) : null;
  const isByHand = item.group === 'manual';
  const tick = isByHand && !isLocked ? html('button', { type: 'button', class: 'key', 'data-does': 'done' }, 'Done now') : null;
  const why = isLocked ? null : html('button', { type: 'button', class: 'key', 'aria-haspopup': 'dialog' }, item.group === 'automatic' ? 'Not applicable' : 'Change');
  const keys = [fix, tick, why].filter((key) => key !== null);
  const element = html('li', { class: 'dep-failed' }, html('div', { class: 'dep-head' }, icon('crit'), title, allowed), html('div', { class: 'dep-fix' }, line, html('div', { class: 'dep-keys' }, ...keys)));
  return { element, body: null, title, line, allowed, tick, fix, why, isNow: /** @type {const} */ (false), isFailed: /** @type {const} */ (true) };
}

/** @param {Item} item @param {Face} _ @param {boolean} isLocked */
function nowParts(item, _, isLocked) {
  const title = html('b', { class: 't' });
  const line = html('span', { class: 'm' });
  const value = html('span', { class: 'n v' });
  const unit = html('span', { class: 'u' });
  const body = html(isLocked ? 'div' : 'button', { class: 'dep-body', ...(isLocked ? {} : { type: 'button', 'aria-haspopup': 'dialog' }) }, title, html('span', { class: 'big' }, value, unit), line);
  const bar = new Bar(item);
  const element = html('li', { class: 'dep-now' }, body, bar.element);
  const draw = (/** @type {Item} */ now) => {
    const [number, unitText] = valueOf(now);
    setText(value, number);
    setText(unit, unitText);
    bar.draw(now);
  };
  return { element, body, title, line, draw, tick: null, fix: null, why: null, isNow: /** @type {const} */ (true), isFailed: /** @type {const} */ (false) };
}

/** What is seen against what is needed; the peak is held. */
class Bar {
  fill = html('i', { class: 'fill' });
  peak = html('i', { class: 'peak' });

  /** @param {Item} item */
  constructor(item) {
    const { needs, ticks } = barOf(item);
    const wedge = (/** @type {number} */ at, /** @type {number} */ i) => {
      const need = html('i', { class: 'need' }, ...(i === 0 ? [html('span', {}, `≥ ${plain(item.need ?? 0)}${item.unit === '°' ? '' : ' '}${item.unit}`)] : []));
      need.style.setProperty('--at', `${at}%`);
      setAttribute(need, 'data-side', at > 60 ? 'left' : null); // its words stay within the bar
      return need;
    };
    this.element = html('div', { class: 'dep-bar', role: 'img', 'aria-label': `${item.title}: needed ${plain(item.need ?? 0)} ${item.unit}` },
      html('div', { class: 'track' }, this.fill, this.peak), ...needs.map(wedge),
      ...ticks.map(({ at, text }) => {
        const tick = html('span', { class: 'n tickmark' }, text);
        tick.style.setProperty('--at', `${at}%`);
        return tick;
      }));
  }

  /** @param {Item} item */
  draw(item) {
    const { from, to, peak } = barOf(item);
    this.fill.style.setProperty('--from', `${from}%`);
    this.fill.style.setProperty('--to', `${to}%`);
    show(this.peak, peak !== null);
    if (peak !== null) this.peak.style.setProperty('--at', `${peak}%`);
  }
}

/** @param {HTMLElement} element @param {() => void} act */
function onLongPress(element, act) {
  let timer = 0;
  let isLong = false;
  const end = () => clearTimeout(timer);
  element.addEventListener('pointerdown', () => {
    end();
    isLong = false;
    timer = window.setTimeout(() => {
      if (!element.isConnected) return; // its row became another one under the finger
      isLong = true;
      act();
    }, LONG_MS);
  });
  element.addEventListener('click', (event) => { // the one that ends a long press is no tick
    if (isLong && event.detail) event.stopImmediatePropagation();
  }, { capture: true });
  for (const type of ['pointerup', 'pointercancel', 'pointerleave']) element.addEventListener(type, end);
  element.addEventListener('contextmenu', (event) => event.preventDefault());
}
