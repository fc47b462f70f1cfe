// The page's store without a browser: what of the window and the document it uses, so that it runs under node.

const listening = { addEventListener() {}, removeEventListener() {}, querySelector: () => null };

/** Takes the place of a browser; returns the store's class. */
export async function storeAlone() {
  Object.assign(globalThis, {
    document: { ...listening, hidden: false, documentElement: { dataset: {} } },
    window: listening,
    requestAnimationFrame: (/** @type {() => void} */ draw) => setTimeout(draw, 16),
    location: { hash: '', pathname: '/', search: '', origin: '' },
  });
  return (await import('../../static/js/core/store.js')).Store;
}
