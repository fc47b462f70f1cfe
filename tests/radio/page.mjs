// The page's own store over a real network: writes what comes and what it would show, a line each.
// Usage: node page.mjs TREE ADDRESS KEY; TREE holds the page's modules.
//   b TIME AGE LATE CUT ALARMS   a fresh frame came: ms since 1970, its true age [ms]; of the link to the car how late [s] and
//                                whether it is cut, and the alarms that are active
//   d TIME                       it dials
//   s TIME COVERED SHOWN TRUE    twenty times a second: the age that is shown and the true one [ms]
import path from 'node:path';
import { WebSocket } from 'ws';
import { storeAlone } from '../page/alone.mjs';

const [tree = '.', address = '', key = ''] = process.argv.slice(2);
console.error = () => {}; // nothing is drawn here
const Store = await storeAlone(path.resolve(tree, 'static/js'));
const store = new Store(() => {
  console.log(`d ${Date.now()}`);
  return new WebSocket(address, { headers: { Authorization: `Bearer ${key}` } }).on('error', () => {}); // one that is given up ends the program without
});
store.painter.picture = store.painter.look = () => {};
const age_ms = () => Date.now() - store.frame.server.time_ms; // server and page run on one machine
store.on('beat', () => {
  const { alarms, link } = store.frame;
  console.log(`b ${Date.now()} ${age_ms()} ${link.late_s ?? 'NaN'} ${Number(link.cut !== null)} ${alarms.filter(({ active }) => active).map(({ id }) => id).join(',') || '-'}`);
});
store.vehicle = 'car';
console.log(`begins ${Date.now()}`);
store.start();
store.sync.greet();
setInterval(() => {
  console.log(`s ${Date.now()} ${Number(store.isSilent || !store.frame)} ${store.frame ? `${store.lag_s * 1000} ${age_ms()}` : '0 0'}`);
}, 50);
