// Keeps the page's shell on this phone, and nothing that is live. The server writes `self.SHELL` before it: which files.
//
// The page itself always comes from the server; only where the server does not answer, a page of its own states it. Files whose
// address holds the hash of their content come from here: another content has another address, so none can be old or mixed.

/**
 * @typedef {{version: string, build: string, named: string[], offline: string}} Kept
 * @typedef {Event & {waitUntil(work: Promise<unknown>): void}} Lasting
 * @typedef {Event & {request: Request, respondWith(answer: Promise<Response>): void}} FetchEvent
 * @typedef {{postMessage(what: unknown, ports: MessagePort[]): void}} Client
 * @typedef {{SHELL: Kept, skipWaiting(): Promise<void>, clients: {claim(): Promise<void>, matchAll(of: object): Promise<Client[]>}}} Scope
 */
const scope = /** @type {Scope & EventTarget} */ (/** @type {unknown} */ (globalThis));
const { version, build, named, offline } = scope.SHELL;
const OURS = 'catgraph-shell-';
const CACHE = `${OURS}${version}`;
const FILES = new Set(named);
/** A page that has not begun to come by then does not come: a phone out of range would wait for minutes [ms]. */
const ANSWERS_MS = 8000;
/** So long another page may take to say which build it is [ms]. */
const SAYS_MS = 1000;

scope.addEventListener('install', (event) => /** @type {Lasting} */ (event).waitUntil(keep()));
scope.addEventListener('activate', (event) => /** @type {Lasting} */ (event).waitUntil(begin()));
scope.addEventListener('message', (event) => {
  const { data } = /** @type {MessageEvent} */ (event);
  if (data?.kind === 'take') /** @type {Lasting} */ (event).waitUntil(take());
});
scope.addEventListener('fetch', (event) => {
  const { request, respondWith } = /** @type {FetchEvent} */ (event);
  if (request.method !== 'GET') return;
  const { origin, pathname, search } = new URL(request.url);
  if (origin !== location.origin) return;
  if (request.mode === 'navigate') {
    if (pathname === '/') respondWith.call(event, page(request)); // anything else, as a download, is none of ours
  } else if (FILES.has(pathname + search)) respondWith.call(event, kept(pathname + search, request));
});

/** All or nothing: a shell with a file missing is none, and the one before it stays. */
async function keep() {
  const cache = await caches.open(CACHE);
  try {
    await cache.addAll([...named, new Request(offline, { cache: 'reload' })]);
  } catch (error) {
    await caches.delete(CACHE);
    throw error;
  }
}

async function begin() {
  const names = await caches.keys();
  await Promise.all(names.filter((name) => name.startsWith(OURS) && name !== CACHE).map((name) => caches.delete(name)));
  await scope.clients.claim();
}

/** Takes over from the worker before it once no page is open that would still ask for that one's files. */
async function take() {
  const pages = await scope.clients.matchAll({ type: 'window', includeUncontrolled: true });
  const builds = await Promise.all(pages.map(buildOf));
  if (builds.every((one) => one === build)) await scope.skipWaiting();
}

/** @param {Client} client @returns {Promise<string | null>} */
function buildOf(client) {
  return new Promise((resolve) => {
    const { port1, port2 } = new MessageChannel();
    port1.onmessage = ({ data }) => resolve(String(data));
    setTimeout(() => resolve(null), SAYS_MS);
    client.postMessage({ kind: 'which' }, [port2]);
  });
}

/** @param {Request} request @returns {Promise<Response>} */
async function page(request) {
  const late = new Promise((_, reject) => {
    setTimeout(() => reject(new Error('The server took too long.')), ANSWERS_MS);
  });
  try {
    return await /** @type {Promise<Response>} */ (Promise.race([fetch(request), late]));
  } catch {
    return found(offline);
  }
}

/** @param {string} address @param {Request} request @returns {Promise<Response>} */
async function kept(address, request) {
  return (await caches.match(address, { cacheName: CACHE })) ?? fetch(request);
}

/** @param {string} address @returns {Promise<Response>} */
async function found(address) {
  return (await caches.match(address, { cacheName: CACHE })) ?? Response.error();
}
