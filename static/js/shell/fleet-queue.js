// The attention queue: one element for each item, kept as long as the item is, so that a finger and the focus stay where they are.

import { PagedList } from '../alarms/pager.js';
import { field, html, icon, setAttribute, setIcon, setText, setSentence, show, svg } from '../core/dom.js';
import { duration } from '../core/format.js';
import { Meant } from '../core/meant.js';

/**
 * @typedef {import('./fleet-layout.js').Item} Item
 * @typedef {import('./fleet-layout.js').Act} Act
 */

const ACTS = /** @type {Act[]} */ (['take', 'accept', 'decline', 'open', 'hand', 'over', 'withdraw', 'release', 'hush', 'off', 'on', 'show']);
/** What concerns this page alone: a viewer may. @type {Set<Act>} */
const OWN = new Set(['open', 'hush', 'show']);

/**
 * Brings the children of a list into this order and no others, moving as few as it can; the focus stays.
 * @param {Element} list
 * @param {Element[]} wanted
 */
export function arrange(list, wanted) {
  const focused = document.activeElement;
  const isInside = focused instanceof HTMLElement && list.contains(focused);
  const keep = new Set(wanted);
  for (const child of [...list.children]) if (!keep.has(child)) child.remove();
  wanted.forEach((one, i) => {
    if (list.children[i] !== one) list.insertBefore(one, list.children[i] ?? null);
  });
  if (isInside && focused !== document.activeElement && list.contains(focused)) focused.focus({ preventScroll: true });
}

export class Queue {
  /** @type {Map<string, ItemView>} */
  #views = new Map();
  #laid = '';

  /**
   * @param {HTMLElement} root
   * @param {(act: Act, item: Item, key: HTMLElement) => void} act
   * @param {() => boolean} isPaged a wide window shows whole items, page after page; a phone scrolls
   */
  constructor(root, act, isPaged) {
    this.act = act;
    this.isPaged = isPaged;
    this.list = field(root, 'items');
    this.title = field(root, 'queue-title');
    this.head = field(root, 'queue-head');
    this.pager = new PagedList(this.list, () => {});
    this.more = field(root, 'queue-pager');
    this.more.append(this.pager.element);
  }

  /** @param {Item[]} items @param {string} head @param {boolean} isViewer */
  draw(items, head, isViewer) {
    setSentence(this.head, head);
    const had = this.#focused();
    const views = items.map((item, i) => {
      const view = this.#views.get(item.key) ?? new ItemView((act, key) => this.act(act, view.item, key));
      this.#views.set(item.key, view);
      view.draw(item, i, isViewer);
      return view;
    });
    arrange(this.list, views.map(({ element }) => element));
    for (const [key, view] of this.#views) if (!views.includes(view)) this.#views.delete(key);
    this.#lay(items);
    if (had !== null && !this.list.contains(document.activeElement) && document.activeElement === document.body) (views[Math.min(had, views.length - 1)]?.first ?? this.title).focus();
  }

  /** Place in the queue of the item that has the focus. */
  #focused() {
    const index = [...this.list.children].findIndex((child) => child.contains(document.activeElement));
    return index < 0 ? null : index;
  }

  /** Pages are measured anew where an item came, went or has other keys. @param {Item[]} items */
  #lay(items) {
    const isPaged = this.isPaged();
    const key = `${isPaged} ${this.list.clientHeight} ${items.map((item) => `${item.key} ${item.keys.length} ${item.timer !== null} ${item.detail !== ''} ${item.isUnowned === true}`).join('|')}`;
    if (key !== this.#laid) {
      this.#laid = key;
      if (isPaged) this.pager.lay();
      else for (const child of this.list.children) show(child, true);
    }
    show(this.more, isPaged && this.pager.shown[1] - this.pager.shown[0] < items.length);
  }
}

/** One item. */
class ItemView {
  mark = icon('crit');
  name = html('h3');
  since = html('span', { class: 'n s' });
  title = html('span', { class: 't' });
  detail = html('span', { class: 'h' });
  who = html('span');
  next = html('span', { class: 'x' });
  bar = svg('rect', { class: 'e1', width: 0, height: 4 });
  timer = svg('svg', { class: 'esc', viewBox: '0 0 100 4', preserveAspectRatio: 'none', 'aria-hidden': 'true' }, svg('rect', { class: 'e0', width: 100, height: 4 }), this.bar);
  /** @type {Map<Act, HTMLElement>} */
  keys = new Map();
  /** @type {Item} */
  item = /** @type {any} */ (null);
  #index = -1;
  #meant;

  /** @param {(act: Act, key: HTMLElement) => void} act */
  constructor(act) {
    this.row = html('div', { class: 'ks' });
    this.element = html('li', { class: 'item' }, html('span', { class: 'mk' }, this.mark), this.name, this.since, this.title, this.detail,
      html('span', { class: 'o' }, icon('operator', 's'), this.who), this.next, this.timer, this.row);
    for (const name of ACTS) {
      const key = html('button', { type: 'button', class: 'key', 'data-act': name, hidden: true });
      key.addEventListener('click', (event) => {
        const isMeant = event.detail === 0 || this.#meant.by(event);
        if (isMeant && !key.hasAttribute('data-busy')) act(name, key);
      });
      this.keys.set(name, key);
      this.row.append(key);
    }
    this.#meant = new Meant(this.element);
  }

  /** The key that comes first. */
  get first() {
    return [...this.keys.values()].find(({ hidden }) => !hidden) ?? null;
  }

  /** @param {Item} item @param {number} index @param {boolean} isViewer */
  draw(item, index, isViewer) {
    this.item = item;
    if (this.#index !== index) this.#meant.moved();
    this.#index = index;
    const { element } = this;
    setAttribute(element, 'data-item', item.key);
    setAttribute(element, 'data-kind', item.kind || null);
    setAttribute(element, 'data-filled', item.isFilled);
    setAttribute(element, 'data-who', item.who.is);
    setAttribute(element, 'data-up', item.timer?.isUp);
    setAttribute(element, 'data-unowned', item.isUnowned);
    setIcon(this.mark, item.icon);
    setText(this.name, item.name);
    setText(this.since, item.since_s === null ? '–' : duration(item.since_s));
    setSentence(this.title, item.title);
    setSentence(this.detail, item.detail);
    setText(this.who, item.who.text);
    setSentence(this.next, item.next);
    show(this.timer, item.timer !== null);
    if (item.timer) setAttribute(this.bar, 'width', (100 * item.timer.share).toFixed(1));
    this.#drawKeys(item, isViewer);
  }

  /** @param {Item} item @param {boolean} isViewer */
  #drawKeys(item, isViewer) {
    for (const [name, key] of this.keys) {
      const one = item.keys.find(({ act }) => act === name);
      show(key, one !== undefined);
      if (!one) continue;
      setText(key, one.label);
      setAttribute(key, 'aria-label', `${one.label}: ${item.name}`);
      setAttribute(key, 'class', one.isMain ? 'key solid' : 'key');
      setAttribute(key, 'aria-expanded', name === 'show' ? String(one.label.startsWith('Hide')) : null);
      setAttribute(key, 'aria-disabled', (isViewer && !OWN.has(name)) || key.hasAttribute('data-busy') ? 'true' : null);
    }
  }
}
