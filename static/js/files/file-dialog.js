// The sheet of a recording's actions: a title, messages, actions, and the key that closes it.

import { addSheet, closeSheet, openSheet } from '../shell/sheet.js';
import { html, icon, listen, setAttribute, setText, textNodes } from '../core/dom.js';

/** What only an operator may do with a recording, by its icon. */
const CHANGES = ['mail', 'crit', 'edit', 'info', 'trash', 'upload'];

export class FileDialog {
  /** @param {HTMLElement} dock where it stands on a desktop, beside the list; elsewhere that is not shown */
  constructor(dock) {
    this.dock = dock;
    const nth = document.querySelectorAll('.file-sheet').length || ''; // another one may lie beneath the connect screen
    this.title = html('h2', { id: `file-title${nth}`, tabindex: -1, dir: 'auto' });
    this.about = html('div', { class: 'bd', id: `file-about${nth}`, tabindex: 0, role: 'group', 'aria-labelledby': `file-title${nth}` });
    this.what = html('div', { class: 'what' });
    this.keys = html('div', { class: 'keys' });
    this.closing = html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close');
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed file-sheet', id: `sheet-file${nth}`, 'aria-labelledby': `file-title${nth}`, 'aria-describedby': `file-about${nth}` }, this.about, this.what, this.keys));
    this.keys.append(this.closing);
    this.remove = addSheet(this.sheet);
  }

  get isOpen() {
    return this.sheet.open;
  }

  /** Does it stand beside the list? */
  get isDocked() {
    return this.dock.offsetParent !== null;
  }

  /** In its dock it takes no focus. */
  open() {
    const { dock, isDocked, sheet } = this;
    const place = isDocked ? dock : document.body;
    if (sheet.parentElement !== place) {
      sheet.removeAttribute('open');
      place.append(sheet);
    }
    setAttribute(sheet, 'data-docked', isDocked);
    if (isDocked) sheet.setAttribute('open', '');
    else openSheet(sheet);
  }

  close() {
    closeSheet(this.sheet);
  }

  /** Called when it is closed, by whatever. @param {() => void} act */
  onClose(act) {
    return listen(this.sheet, 'close', act);
  }

  /**
   * @param {string} title
   * @param {(Node | string)[]} about
   * @param {Node[]} what
   * @param {Node[]} keys above the one that closes
   * @param {string} [closes] what that one is called
   */
  show(title, about, what, keys = [], closes = 'Close') {
    const takesFocus = this.sheet.open && (!this.isDocked || this.sheet.contains(document.activeElement));
    setText(this.title, title);
    this.about.replaceChildren(this.title, ...about);
    this.what.replaceChildren(...what);
    this.keys.replaceChildren(...keys, this.closing);
    setText(this.closing, closes);
    this.what.scrollTop = 0;
    if (takesFocus) this.title.focus();
  }

  /** @param {string} title @param {string} sentence @param {() => void} [back] */
  refuse(title, sentence, back) {
    this.show(title, [html('p', { class: 'bad', role: 'alert' }, ...textNodes(sentence))], [], back ? [this.key('Back', back)] : []);
  }

  /**
   * @param {string} glyph
   * @param {string} label
   * @param {() => void} act
   * @param {string} [end] a label at its end
   */
  item(glyph, label, act, end = '') {
    const key = html('button', { type: 'button', 'data-operator': CHANGES.includes(glyph) }, icon(glyph), label, ...(end ? [html('span', { class: 'end' }, ...textNodes(end))] : []));
    listen(key, 'click', act);
    return html('li', {}, key);
  }

  /** @param {string} label @param {() => void} act @param {string} [kind] */
  key(label, act, kind = 'key') {
    const key = html('button', { type: 'button', class: kind }, label);
    listen(key, 'click', act);
    return key;
  }
}
