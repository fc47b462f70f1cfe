// The log of a real page, driven by lines of JSON: {"hello": …} is answered by what the page has, {"events": …} by what is new to it.
import readline from 'node:readline';

import { EventLog } from '../../static/js/core/event-log.js';

let log = new EventLog();
for await (const line of readline.createInterface({ input: process.stdin })) {
  const command = JSON.parse(line);
  let answer = {};
  if (command.hello) answer = { have_event: log.greet(command.hello, 5, 0), boot: log.boot };
  else if (command.events) {
    const fresh = log.take(command.events, command.resumed);
    answer = { fresh: fresh.map(({ text }) => text), rows: log.events.map(({ text }) => text) };
  } else log = new EventLog();
  process.stdout.write(`${JSON.stringify(answer)}\n`);
}
