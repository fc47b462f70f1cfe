// The page's own store over a real network: writes what comes and what it would show, a line each.
// Usage: node page.mjs TREE ADDRESS KEY; TREE holds the page's modules.
//   b TIME AGE LATE CUT ALARMS   a fresh frame came: ms since 1970, its true age [ms]; of the link to the car how late [s] and
//                                whether it is cut, and the alarms that are active
//   d TIME                       it dials
//   s TIME COVERED SHOWN TRUE    twenty times a second: the age that is shown and the true one [ms]
//   f TIME AGE                   then, where values are drawn as fresh: the true age of the oldest of them [ms]; without those of slow topics, which may be older
import path from 'node:path';
import { WebSocket } from 'ws';
import { storeAlone } from '../page/alone.mjs';

const [tree = '.', address = '', key = ''] = process.argv.slice(2);
console.error = () => {}; // nothing is drawn here
const Store = await storeAlone(path.resolve(tree, 'static/js'));
const store = new Store(() => {
  console.log(`d ${Date.now()}`);
  return new WebSocket(address, key ? { headers: { Authorization: `Bearer ${key}` } } : {}).on('error', () => {}); // without it, a connection that is given up ends the program
});
store.painter.picture = store.painter.look = () => {};
// Server and page run on one machine. What an agent's device signs is a moment of the monotonic clock; a web node replaces the time of day by its own estimate.
const isOfNode = new URL(address).searchParams.has('vehicle');
const age_ms = () => {
  const { challenge, time_ms } = store.frame.server;
  return challenge ? Number(process.hrtime.bigint() / 1_000_000n) - Number.parseInt(challenge, 16) : isOfNode ? NaN : Date.now() - time_ms;
};
const oldestFresh_ms = () => {
  const fresh = Object.entries(store.frame.signals).filter(([name, { age_s, horizon_s }]) => age_s !== null && (horizon_s ?? 1) <= 1 && store.ink(name).ink === 'fresh');
  return fresh.length ? Math.max(...fresh.map(([, { age_s }]) => 1000 * age_s)) + age_ms() : null;
};
store.on('beat', () => {
  const { alarms, link } = store.frame;
  console.log(`b ${Date.now()} ${age_ms()} ${link.late_s ?? 'NaN'} ${Number(link.cut !== null)} ${alarms.filter(({ active }) => active).map(({ id }) => id).join(',') || '-'}`);
});
store.vehicle = new URL(address).searchParams.get('vehicle') ?? 'car';
console.log(`begins ${Date.now()}`);
store.start();
store.sync.greet();
setInterval(() => {
  const isCovered = store.isSilent || !store.frame;
  console.log(`s ${Date.now()} ${Number(isCovered)} ${store.frame ? `${store.lag_s * 1000} ${age_ms()}` : '0 0'}`);
  const oldest_ms = isCovered ? null : oldestFresh_ms();
  if (oldest_ms !== null) console.log(`f ${Date.now()} ${oldest_ms}`);
}, 50);
