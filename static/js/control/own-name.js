// The name under which the server knows this page and the phone it is on, over reconnections and reloads.

const NAME = 'catgraph.phone';

/** @type {string | null} */
let own = null;

/** Made once, and kept as long as the tab is. */
export function ownName() {
  own ??= kept() ?? made();
  return own;
}

function kept() {
  try {
    return sessionStorage.getItem(NAME);
  } catch {
    return null; // storage may be forbidden
  }
}

function made() {
  const name = [...crypto.getRandomValues(new Uint8Array(8))].map((byte) => byte.toString(16).padStart(2, '0')).join('');
  try {
    sessionStorage.setItem(NAME, name);
  } catch {
    // then a reload is another page
  }
  return name;
}
