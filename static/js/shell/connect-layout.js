// The connect screen: its texts, and the addresses that it offers.

const KEY = 'catgraph.addresses';
const KEPT = 8;

/**
 * @typedef {import('../boot/arming.js').Armed} Armed
 * @typedef {{name: string, address: string | null, phase?: string}} Found
 */

/**
 * The texts of an item of the arming list.
 * @param {'sound' | 'screen' | 'position'} what
 * @param {Armed} state
 * @returns {{tag: string, kind: 'plain' | 'warn' | 'unk', cost: string}}
 */
export function armWords(what, state) {
  if (state === 'ready') return { tag: 'Ready', kind: 'plain', cost: '' };
  if (state === 'asks') return { tag: 'Will ask', kind: 'unk', cost: '' };
  const cost = {
    sound: 'alarms are shown without sound',
    screen: 'the screen may turn off and hide alarms',
    position: 'phone and car are not compared',
  }[what];
  if (state === 'refused') return { tag: 'Refused', kind: 'warn', cost: `Refused: ${cost}` };
  const why = what === 'sound' ? 'This browser has no sound' : 'Needs HTTPS';
  return { tag: 'Not available', kind: 'warn', cost: `${why}: ${cost}` };
}

/**
 * The addresses used before with the newest one first, each once.
 * @param {string[]} before
 * @param {string} address
 */
export function remembered(before, address) {
  return [address, ...before.filter((one) => one !== address)].slice(0, KEPT);
}

/**
 * The vehicles of GET /api/vehicles, each address once: found ones first, then those the server watches already.
 * @param {any} answer
 * @returns {Found[]}
 */
export function foundIn(answer) {
  const all = [...(Array.isArray(answer?.found) ? answer.found : []), ...(Array.isArray(answer?.vehicles) ? answer.vehicles : [])];
  const seen = new Set();
  return all.filter((one) => typeof one?.address === 'string' && one.address && !seen.has(bare(one.address)) && seen.add(bare(one.address)))
    .map((one) => ({ name: String(one.name ?? 'Vehicle'), address: one.address, phase: one.phase }));
}

/**
 * What was pending when the server ended, and how to return to it.
 * @param {import('../core/protocol-types.js').SessionState['held']} held
 */
export function heldWords(held) {
  if (!held?.address || (!held.alarms && !held.paused)) return '';
  const alarms = held.alarms ? `${held.alarms} ${held.alarms === 1 ? 'alarm was active' : 'alarms were active'}` : '';
  const what = [alarms, held.paused ? 'monitoring was paused' : ''].filter(Boolean).join(' and ');
  return `The server was restarted while it monitored ${bare(held.address)}: ${what}. Connect to it to continue.`;
}

/**
 * An address as an operator writes it: without the scheme, where it names a port.
 * @param {string} address
 */
export function bare(address) {
  const plain = address.replace(/\/$/, '');
  return /^ws:\/\/(\[[^\]]*\]|[^:/?#]+):\d/.test(plain) ? plain.slice('ws://'.length) : plain;
}

/** @type {Record<string, number>} */
const PORTS = { ws: 80, wss: 443, foxglove: 8765, 'foxglove+tls': 8765 }; // of a URL without a port (RFC 6455); a host alone has rosbridge's own
const PORT = 9090;
const MASTER_PORT = 11311; // of a ROS master, which is refused
const LONGEST = 300; // letters
const HOST = /^(?=.{1,253}$)[a-z\d_]([\w-]{0,61}[a-z\d_])?(\.[a-z\d_]([\w-]{0,61}[a-z\d_])?)*\.?$/i;

/**
 * What the server dials for an address, as in `server/rosbridge/address.py`; empty for one that it refuses.
 * @param {string} typed
 */
export function dialled(typed) {
  const text = typed.trim();
  if ([...text].length > LONGEST || /[\p{C}\p{Z}]/u.test(text)) return '';
  const [, scheme = '', after = text] = /^(wss?|foxglove(?:\+tls)?):\/\/(.*)$/i.exec(text) ?? [];
  const isIpv6 = scheme === '' && isHost(`[${text}]`);
  const parts = /^(\[[\da-f:.]+\]|[\w.-]+)(?::(\d*))?([/?][^#]*)?(?:#.*)?$/i.exec(isIpv6 ? `[${text}]` : after);
  if (!parts || (scheme === '' && /:\/\/|^(?:wss?|foxglove(?:\+tls)?):\/?(?=[^/\d]|\d+\.)/i.test(text))) return '';
  const [, host = '', written = '', path = ''] = parts;
  if (!isHost(host)) return '';
  const dials = scheme.toLowerCase() || 'ws';
  const port = written === '' ? (scheme === '' ? PORT : PORTS[dials]) : Number(written);
  if (port < 1 || port > 65535 || port === MASTER_PORT) return '';
  return `${dials}://${host.toLowerCase()}:${port}${sent(path)}`;
}

/** A path as it is sent. @param {string} path with its query */
function sent(path) {
  const whole = path.replace(/^([^?]*)\?$/, '$1').replace(/^\?/, '/?');
  return whole === '/' ? '' : encodeURI(whole).replaceAll('%25', '%');
}

/** Whether this is a host name, an IPv4 address, or an IPv6 address in brackets. @param {string} text */
function isHost(text) {
  if (!text.startsWith('[')) return HOST.test(text);
  if (!/^\[[\da-f:.]+\]$/i.test(text)) return false;
  try {
    return Boolean(new URL(`ws://${text}`));
  } catch {
    return false;
  }
}

/** Whether both are addresses of one server; the usual port may be left out. @param {string} one @param {string} other */
export function isSameCar(one, other) {
  const [a, b] = [one, other].map((address) => dialled(address) || address.trim());
  return a === b;
}

/** The addresses used before on this phone, newest first. @returns {string[]} */
export function addresses() {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY) ?? '[]');
    return Array.isArray(kept) ? kept.filter((one) => typeof one === 'string') : [];
  } catch {
    return [];
  }
}

/** Stores an address as the newest one. @param {string} address */
export function keep(address) {
  try {
    localStorage.setItem(KEY, JSON.stringify(remembered(addresses(), address)));
  } catch {
    // without storage the address is lost
  }
}
