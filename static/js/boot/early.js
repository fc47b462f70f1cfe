// Before the first paint: the theme and the hand this phone's operator chose (without a choice the phone's own theme holds),
// and the socket to the server is dialled while the page's script is still on its way. early-socket.js takes it over.
(() => {
  const root = document.documentElement;
  try {
    const theme = localStorage.getItem('catgraph.theme');
    if (theme === 'dark' || theme === 'light') root.dataset.theme = theme;
    if (localStorage.getItem('catgraph.hand') === 'left') root.dataset.hand = 'left';
  } catch {
    // no storage: the phone's setting holds
  }

  const { access } = root.dataset;
  if (!access) return; // the page for when the server does not answer
  if (!new URLSearchParams(location.search).has('vehicle')) root.dataset.vehicle = ownCar() ?? root.dataset.vehicle;
  const { vehicle } = root.dataset;
  /** @type {import('./early-socket.js').Early} */
  const early = { queue: [], handle: null, socket: null };
  /** @type {any} */ (globalThis).catgraphEarly = early;
  ticketOf(access).then(dial).catch(() => pass('close'));

  /** The car that this phone opened last, where the server still has it. */
  function ownCar() {
    try {
      const car = localStorage.getItem('catgraph.car');
      return car && (root.dataset.vehicles ?? '').split(' ').includes(car) ? car : null;
    } catch {
      return null; // no storage: the server's first car
    }
  }

  /** Where devices are paired, a socket needs one. @param {string} way @returns {Promise<string | null>} */
  async function ticketOf(way) {
    if (way !== 'paired') return null;
    const answer = await fetch('/api/ticket', { method: 'POST', cache: 'no-store' }); // how long to wait is decided by the owner of the socket
    return (await answer.json()).ticket;
  }

  /** @param {string | null} ticket */
  function dial(ticket) {
    if (ticket === undefined) throw new Error('no ticket'); // the loaded page finds and shows the reason
    if (early.isGivenUp) return;
    const address = new URL('/ws', location.href);
    address.protocol = location.protocol === 'https:' ? 'wss:' : 'ws:';
    if (vehicle) address.searchParams.set('vehicle', vehicle);
    if (ticket !== null) address.searchParams.set('ticket', ticket);
    const socket = new WebSocket(address);
    early.socket = socket;
    early.dialled_ms = performance.now();
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => pass('open');
    socket.onmessage = ({ data }) => pass('message', data);
    socket.onclose = () => pass('close');
  }

  /** @param {'open' | 'message' | 'close'} type @param {string | ArrayBuffer} [data] */
  function pass(type, data) {
    const event = { type, data, at_ms: performance.now() };
    if (early.handle) early.handle(event);
    else early.queue.push(event);
  }
})();
