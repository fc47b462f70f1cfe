// Any part of the page asks for a screen; shell/screens.js shows it.

/**
 * @param {string} screen
 * @param {string} [of] what of: the id of a check
 */
export function openScreen(screen, of) {
  window.dispatchEvent(new CustomEvent('catgraph-open', { detail: { screen, of } }));
}
