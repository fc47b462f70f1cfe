// Instead of a worker: what an earlier one kept on this phone goes, and then this one too. No page is touched.

/**
 * @typedef {Event & {waitUntil(work: Promise<unknown>): void}} Ending
 * @typedef {{skipWaiting(): Promise<void>, registration: {unregister(): Promise<boolean>}}} Leaving
 */
(() => {
  const scope = /** @type {Leaving & EventTarget} */ (/** @type {unknown} */ (globalThis));
  scope.addEventListener('install', () => void scope.skipWaiting());
  scope.addEventListener('activate', (event) => /** @type {Ending} */ (event).waitUntil(go()));

  async function go() {
    const names = await caches.keys();
    await Promise.all(names.filter((name) => name.startsWith('catgraph-shell-')).map((name) => caches.delete(name)));
    await scope.registration.unregister();
  }
})();
