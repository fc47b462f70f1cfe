// The page's store without a browser: what of the window and the document it uses, so that it runs under node.

const listening = { addEventListener() {}, removeEventListener() {}, querySelector: () => null };

/** Takes the place of a browser; returns the store's class. @param {string} [folder] of the page's modules */
export async function storeAlone(folder = '../../static/js') {
  Object.assign(globalThis, {
    document: { ...listening, hidden: false, documentElement: { dataset: {} } },
    window: listening,
    requestAnimationFrame: (/** @type {() => void} */ draw) => setTimeout(draw, 16),
    location: { hash: '', pathname: '/', search: '', origin: '' },
  });
  return /** @type {typeof import('../../static/js/core/store.js')} */ (await import(`${folder}/core/store.js`)).Store;
}
