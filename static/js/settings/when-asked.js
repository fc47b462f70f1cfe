// Fetches what asks the operator with the first question: most drives have none.

/** After a failure it is fetched again with a later frame [ms]. */
const AGAIN_MS = 1000;

/**
 * @param {HTMLElement} monitor
 * @param {import('../core/store.js').Store} store
 * @param {(sentence: string, title?: string) => void} say
 */
export function whenAsked(monitor, store, say) {
  const off = store.on('draw', () => {
    if (!store.frame?.questions?.length) return;
    off();
    import('./questions.js').then(({ mount }) => mount(monitor, store, say)).catch(() => setTimeout(() => whenAsked(monitor, store, say), AGAIN_MS));
  });
}
