// Fetches what asks the operator with the first question: most drives have none.

/** After a failure it is fetched again with a later frame [ms]. */
const AGAIN_MS = 1000;

/**
 * @param {HTMLElement} monitor
 * @param {import('../core/store.js').Store} store
 * @param {(sentence: string, title?: string) => void} say
 */
export function whenAsked(monitor, store, say) {
  let isLoading = false;
  const off = store.on('draw', () => {
    if (isLoading || !store.frame?.questions?.length) return;
    isLoading = true;
    import('./questions.js').then(({ mount }) => {
      off();
      return mount(monitor, store, say);
    }).catch(() => setTimeout(() => { isLoading = false; }, AGAIN_MS));
  });
}
