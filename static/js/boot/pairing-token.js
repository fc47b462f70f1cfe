// The token of a pairing link, `#pair=TOKEN`: taken out of the address bar before anything else looks at it. A fragment is
// never sent to a server; in the history, in a shared link or in a screenshot it would still be a key lying about.

const MARK = '#pair=';

/** @type {string | null} */
let token = taken();

/** The token this page was opened with; it lets in once, so it is handed out once. */
export function linkToken() {
  const once = token;
  token = null;
  return once;
}

/** A link that is scanned while the page is open changes its fragment only. @param {() => void} came */
export function onLink(came) {
  window.addEventListener('hashchange', () => {
    const found = taken();
    if (found === null) return;
    token = found;
    came();
  }, { capture: true });
}

/**
 * Where a link led before this device was known: only to what this server has itself.
 * @param {string | null} then
 * @param {string} [here]
 */
export function thenOf(then, here = location.origin) {
  if (!then || !/^\/(api\/|agents\/|docs$|fleet$|metrics$)/.test(then)) return null;
  const url = new URL(then, here);
  return url.origin === here ? url.pathname + url.search : null;
}

function taken() {
  if (!location.hash.startsWith(MARK)) return null;
  const found = location.hash.slice(MARK.length);
  history.replaceState(history.state, '', location.pathname + location.search);
  return /^[\w-]{10,100}$/.test(found) ? found : null;
}
