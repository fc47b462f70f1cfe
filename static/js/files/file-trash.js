// Recordings into the trash, back out of it, or gone for good.

import { nameOf, sizeWords } from './files-layout.js';
import { sentenceOf } from '../control/request.js';
import { html, textNodes } from '../core/dom.js';

/** @typedef {import('./files-layout.js').Recording} Recording */

export class FileTrash {
  #dialog;
  #model;
  #say;

  /**
   * @param {import('./file-dialog.js').FileDialog} dialog
   * @param {import('./files-model.js').FilesModel} model
   * @param {import('./files-sheet.js').Say} say
   */
  constructor(dialog, model, say) {
    this.#dialog = dialog;
    this.#model = model;
    this.#say = say;
  }

  /** @param {Recording} row @param {() => void} back */
  askDelete(row, back) {
    const name = nameOf(row, Date.now());
    this.#dialog.show(`Delete ${name}?`, [html('p', {}, ...textNodes('It is moved to the trash and can be restored until the trash is emptied.'))], [], [this.#dialog.key('Delete', () => this.#delete(row, back), 'main')], 'Keep it');
  }

  /** @param {Recording} row @param {() => void} back */
  async #delete(row, back) {
    const name = nameOf(row, Date.now());
    try {
      await this.#model.remove(row.id);
    } catch (error) {
      this.#dialog.refuse('Not deleted', sentenceOf(error), back);
      return;
    }
    this.#dialog.close();
    this.#say(`${name} is in the trash.`, 'Deleted', { label: 'Undo', act: () => this.#restore(row, name) });
  }

  /** @param {Recording} row @param {string} name */
  async #restore(row, name) {
    try {
      await this.#model.restore(row.id);
      this.#say(`${name} is back in the list.`, 'Taken back');
    } catch (error) {
      this.#say(sentenceOf(error), 'Not restored');
    }
  }

  /** What can be done with one that is in the trash. @param {Recording} row @param {Node[]} about */
  show(row, about) {
    const name = nameOf(row, Date.now());
    this.#dialog.show(name, about, [html('ul', { class: 'menu-list' },
      this.#dialog.item('replay', 'Restore', async () => {
        this.#dialog.close();
        await this.#restore(row, name);
      }),
      this.#dialog.item('trash', 'Delete for good', () => this.#askDestroy(row.id, `Delete ${name} for good?`, `${sizeWords(row.size_bytes)} are freed. This cannot be undone.`), 'confirm first'))]);
  }

  /** All of the trash, after a question. @param {import('./files-layout.js').Total} total */
  askEmpty({ count, bytes }) {
    this.#askDestroy(null, 'Empty the trash?', `${count === 1 ? '1 recording is' : `${count} recordings are`} deleted for good, ${sizeWords(bytes)} are freed. ${count === 1 ? 'It' : 'They'} cannot be restored.`);
    this.#dialog.open();
  }

  /** @param {string | null} id @param {string} title @param {string} sentence */
  #askDestroy(id, title, sentence) {
    this.#dialog.show(title, [html('p', {}, ...textNodes(sentence))], [], [this.#dialog.key(id === null ? 'Empty the trash' : 'Delete for good', async () => {
      try {
        await this.#model.destroy(id);
        this.#dialog.close();
      } catch (error) {
        this.#dialog.refuse('Not deleted', sentenceOf(error));
      }
    }, 'main')], 'Keep');
  }
}
