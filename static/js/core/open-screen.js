// Any part of the page can request a screen; shell/screens.js shows it.

/**
 * @param {string} screen
 * @param {string} [of] what of: the id of a check
 */
export function openScreen(screen, of) {
  window.dispatchEvent(new CustomEvent('catgraph-open', { detail: { screen, of } }));
}

/** What is to be searched for in Settings, which may not be loaded yet. */
let wanted = '';

/** Shows the settings that a search finds. @param {string} query */
export function openSettings(query) {
  wanted = query;
  location.hash = '#settings';
  window.dispatchEvent(new Event('catgraph-settings'));
}

/** What is to be searched for, once; '': nothing. */
export function takeWanted() {
  const query = wanted;
  wanted = '';
  return query;
}
