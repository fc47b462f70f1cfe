// What the page's parser makes of each line: its kind, null where it is not understood, or what was thrown.
import { createInterface } from 'node:readline';
import { chainOf } from '../../static/js/core/link.js';
import { readMessage } from '../../static/js/core/protocol.js';

for await (const line of createInterface({ input: process.stdin })) {
  const result = { kind: null, threw: '' };
  try {
    const frame = readMessage(JSON.parse(line));
    result.kind = frame?.kind ?? null;
    if (frame?.kind === 'state') result.link = chainOf({ frame, isSilent: false, silence_s: 0.1, lag_s: 0.1, heard_ms: 0 }).state;
  } catch (error) {
    result.threw = String(error);
  }
  console.log(JSON.stringify(result));
}
