// Pages that order something over a real network, by the page's own modules: a line of JSON for each order once its page knows what became of it.
// Usage: node senders.mjs TREE ADDRESS COUNT; prints `ready` once each page has a state of the car.
// A line on standard input, `WITHIN KINDS`, has each page give one order at a moment of its own within so many ms, of these kinds by turns.
import path from 'node:path';
import readline from 'node:readline';
import { WebSocket } from 'ws';
import { storeAlone } from '../page/alone.mjs';

const [tree = '.', address = '', count = '1'] = process.argv.slice(2);
const vehicle = new URL(address).searchParams.get('vehicle') ?? '';
console.error = () => {}; // nothing is drawn here
const Store = await storeAlone(path.resolve(tree, 'static/js'));
const FIELDS = { take_over: ['control', { do: 'take_over' }], pause: ['pause', {}], resume: ['resume', {}], arm: ['arm', { vehicle }], slow_down: ['slow_down', { vehicle }] };
const ORDERED = new Set(Object.values(FIELDS).map(([kind]) => kind));

class Sender {
  id = ''; // of the newest order that was sent
  found = () => {};

  constructor(name) {
    this.store = new Store(() => this.dial(), () => name, () => `page-${name}`);
    this.store.painter.picture = this.store.painter.look = () => {};
    this.store.on('became', (found) => this.found(found.became));
    this.store.vehicle = vehicle;
    this.store.start();
    this.store.sync.greet();
    setInterval(() => this.present(), 1000);
  }

  /** As a page that somebody looks at: no other one can be in control. */
  present() {
    if (this.store.sync.hasGreeted) this.store.socket.send({ kind: 'present', visible: true, sound: 'ready', awake: 'ready', ...this.store.seal.named });
  }

  dial() {
    const socket = new WebSocket(address).on('error', () => {}); // one that is given up ends the program without
    const send = socket.send.bind(socket);
    socket.send = (data) => {
      const { kind, id = '' } = JSON.parse(data);
      if (ORDERED.has(kind)) this.id = id;
      send(data);
    };
    return socket;
  }

  async give(what) {
    const [kind, fields] = FIELDS[what];
    this.id = '';
    const became = new Promise((resolve) => { this.found = resolve; });
    const pressed_ms = Date.now();
    const { ok, outcome = ok ? 'done' : 'refused', reason = '' } = await this.store.ask(kind, fields);
    const final = outcome === 'unknown' ? await became : outcome;
    console.log(JSON.stringify({ id: this.id, what, pressed_ms, answer: outcome, final, known_ms: Date.now(), reason }));
  }
}

const senders = Array.from({ length: Number(count) }, (_, n) => new Sender(`sender-${n}`));
const waits = setInterval(() => {
  if (!senders.every(({ store }) => store.frame)) return;
  clearInterval(waits);
  console.log('ready');
}, 50);
let turn = 0;
readline.createInterface({ input: process.stdin }).on('line', (line) => {
  const [within_ms, ...kinds] = line.split(' ');
  for (const sender of senders) {
    const what = kinds[turn++ % kinds.length];
    setTimeout(() => void sender.give(what), Math.random() * Number(within_ms));
  }
  turn += 1; // so that each gives all of them
});
