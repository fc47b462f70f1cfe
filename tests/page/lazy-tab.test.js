import assert from 'node:assert/strict';
import { test } from 'node:test';
import { LazyTab } from '../../static/js/shell/lazy-tab.js';

/** An element as far as a tab writes it. */
class Field {
  textContent = 'it is being fetched';
  /** @type {Map<string, string>} */
  #attributes = new Map();

  /** @param {string} name */
  hasAttribute(name) {
    return this.#attributes.has(name);
  }

  /** @param {string} name */
  getAttribute(name) {
    return this.#attributes.get(name) ?? null;
  }

  /** @param {string} name @param {string} value */
  setAttribute(name, value) {
    this.#attributes.set(name, value);
  }

  /** @param {string} name */
  removeAttribute(name) {
    this.#attributes.delete(name);
  }
}

/** A panel with the fields that a tab may write. */
function panelOf() {
  const fields = { 'none-words': new Field(), none: new Field() };
  return { fields, panel: /** @type {any} */ ({ querySelector: (/** @type {string} */ selector) => (/none-words/.test(selector) ? fields['none-words'] : fields.none) }) };
}

/** @param {(() => Promise<string>)[]} answers of the server, one after the other */
function tabOf(answers) {
  const { fields, panel } = panelOf();
  const seen = { isShown: false, fetched: 0, mounted: /** @type {string[]} */ ([]), looks: 0 };
  const tab = new LazyTab(panel, {
    what: 'The scan', state: 'none-words', isShown: () => seen.isShown,
    fetch: () => {
      seen.fetched += 1;
      return (answers.shift() ?? (() => Promise.reject(new Error('no more'))))();
    },
    mount: (module) => {
      seen.mounted.push(module);
      return { look: () => { seen.looks += 1; } };
    },
  });
  return { tab, seen, fields };
}

const settled = () => new Promise((resolve) => { setImmediate(resolve); });

test('a tab is fetched once, when it first comes to the front, and notified of every change after that', async () => {
  const { tab, seen } = tabOf([async () => 'module']);
  tab.look();
  assert.equal(seen.fetched, 0);
  seen.isShown = true;
  tab.look();
  tab.look();
  await settled();
  assert.deepEqual([seen.fetched, seen.mounted, seen.looks], [1, ['module'], 0]);
  seen.isShown = false;
  tab.look();
  assert.deepEqual([seen.fetched, seen.looks], [1, 1]); // behind, a scan is not sent any more
});

test('a tab that cannot be fetched shows it, and is fetched again when it is opened again', async (t) => {
  t.mock.method(console, 'warn', () => {});
  const { tab, seen, fields } = tabOf([() => Promise.reject(new Error('gone')), async () => 'module']);
  seen.isShown = true;
  tab.look();
  await settled();
  assert.equal(fields['none-words'].textContent, 'The scan could not be loaded: the server does not answer. Open this tab again.');
  assert.equal(fields.none.hasAttribute('hidden'), false);
  tab.look();
  await settled();
  assert.deepEqual(seen.mounted, ['module']);
  assert.equal(fields['none-words'].textContent, '');
  assert.equal(fields.none.hasAttribute('hidden'), true);
});
