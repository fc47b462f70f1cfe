// What this phone calls itself in the log: its kind, and a short sign of its own. A label, no proof of who it is.

const KEY = 'catgraph.device';
const SIGNS = 'abcdefghjkmnpqrstuvwxyz23456789'; // none that is mistaken for another

/**
 * The kind of device in a user agent, in short.
 * @param {string} userAgent
 */
export function kindOf(userAgent) {
  const model = /Android [\d.]+; (?!(?:K|wv|Mobile|Tablet)[);])([^;)]{2,24}?)(?: Build\/[^;)]*)?[;)]/.exec(userAgent)?.[1]?.trim();
  if (model) return model;
  const kinds = /** @type {const} */ ([
    [/Android/, 'Android phone'], [/iPhone/, 'iPhone'], [/iPad/, 'iPad'], [/CrOS/, 'Chromebook'], [/Windows/, 'Windows PC'],
    [/Macintosh/, 'Mac'], [/Linux|X11/, 'Linux PC'],
  ]);
  return kinds.find(([mark]) => mark.test(userAgent))?.[1] ?? 'Browser';
}

/**
 * "Pixel 7 · a3f2": kept with the phone, so that it is the same after every reload.
 * @param {string} userAgent
 * @param {{getItem: (key: string) => string | null, setItem: (key: string, value: string) => void} | null} storage
 * @param {(n: number) => number} random a whole number below n
 */
export function deviceName(userAgent, storage, random = (n) => Math.floor(Math.random() * n)) {
  try {
    const kept = storage?.getItem(KEY)?.trim();
    if (kept) return kept.slice(0, 40);
  } catch {
    // no storage: a new sign each time
  }
  const sign = Array.from({ length: 4 }, () => SIGNS[random(SIGNS.length)]).join('');
  const name = `${kindOf(userAgent)} · ${sign}`;
  try {
    storage?.setItem(KEY, name);
  } catch {
    // as above
  }
  return name;
}

/** Where names are kept; a browser may refuse access to it. */
export function keptHere() {
  try {
    return window.localStorage;
  } catch {
    return null;
  }
}
