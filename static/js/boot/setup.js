// On the page of set-up: checks whether this browser trusts the server by now, and shows it.

const LOOK_EVERY_MS = 3000;
const body = document.body;
const secure = body.dataset.secure ?? '';

/** Whether HTTPS to the server succeeds. What it answers does not matter, and this page may not read it. */
async function isTrusted() {
  try {
    await fetch(`${secure}trusted`, { mode: 'no-cors', cache: 'no-store', credentials: 'omit', signal: AbortSignal.timeout(10_000) });
    return true;
  } catch {
    return false;
  }
}

/** Looks until it is trusted, while somebody looks at the page. */
async function look() {
  if (!document.hidden) body.dataset.trust = (await isTrusted()) ? 'yes' : 'no';
  if (body.dataset.trust !== 'yes') setTimeout(look, LOOK_EVERY_MS);
}

look();
export {};
