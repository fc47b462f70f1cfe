// The page while the server does not answer: shows where it was and since when, and tries it again and again.
// A script of its own, kept with the shell; the page itself comes from the server as soon as that answers.

const EVERY_MS = 3000;
const WAITS_MS = 4000; // for an answer

begin();

function begin() {
  const find = (/** @type {string} */ name) => /** @type {HTMLElement} */ (document.querySelector(`[data-f="${name}"]`));
  const [then, where, answered, network, next, key] = ['then', 'where', 'answered', 'network', 'next', 'try'].map(find);
  if (!then || !where || !answered || !network || !next || !key) return;
  let due_ms = performance.now() + EVERY_MS;
  let isTrying = false;

  where.textContent = location.host;
  draw();
  setInterval(look, 500);
  key.addEventListener('click', attempt);
  window.addEventListener('online', attempt);
  document.addEventListener('visibilitychange', () => document.hidden || attempt());

  function look() {
    if (!document.hidden && !isTrying && performance.now() >= due_ms) attempt();
    draw();
  }

  /** Reloads after any answer of the server; the page shows what a refusal means. */
  async function attempt() {
    if (isTrying) return;
    isTrying = true;
    draw();
    try {
      await fetch('/api/health', { cache: 'no-store', signal: AbortSignal.timeout(WAITS_MS) });
      location.reload();
    } catch {
      isTrying = false;
      due_ms = performance.now() + EVERY_MS;
      draw();
    }
  }

  function draw() {
    const last = lastAnswer();
    write(answered, last === null ? 'not known on this device' : `${clock(last.at_ms)}, ${ago(Date.now() - last.at_ms)}`);
    write(then, last?.isMonitoring ? 'A car was being monitored then. It may still be moving.' : '');
    write(network, navigator.onLine ? 'has a network' : 'has no network');
    write(next, isTrying ? 'Trying the server now.' : 'This page tries again every 3 s.');
    write(key, isTrying ? 'Trying' : 'Try now');
  }
}

/** What the page stored when the server last answered. @returns {{at_ms: number, isMonitoring: boolean} | null} */
function lastAnswer() {
  try {
    const { at_ms, isMonitoring } = JSON.parse(localStorage.getItem('catgraph.answered') ?? 'null') ?? {};
    return Number.isFinite(at_ms) ? { at_ms, isMonitoring: isMonitoring === true } : null;
  } catch {
    return null;
  }
}

/** @param {number} at_ms */
function clock(at_ms) {
  const at = new Date(at_ms);
  const two = (/** @type {number} */ part) => String(part).padStart(2, '0');
  const time = `${two(at.getHours())}:${two(at.getMinutes())}:${two(at.getSeconds())}`;
  const isToday = at.toDateString() === new Date().toDateString();
  return isToday ? time : `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())} ${time}`;
}

/** @param {number} ms */
function ago(ms) {
  if (ms < 0) return 'by a clock that was changed since';
  const s = Math.floor(ms / 1000);
  if (s < 60) return `${s} s ago`;
  const minutes = Math.floor(s / 60);
  if (minutes < 60) return `${minutes} min ago`;
  const hours = Math.floor(minutes / 60);
  return hours < 48 ? `${hours} h ago` : `${Math.floor(hours / 24)} days ago`;
}

/** @param {HTMLElement} element @param {string} text */
function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export {};
