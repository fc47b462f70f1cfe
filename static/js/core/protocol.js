// The one place that looks at what came off the socket. Its types are made from the server's: protocol-types.d.ts.

import { understood } from './priority.js';

/** @typedef {import('./protocol-types.js').Message} Message */

/**
 * What a message of each kind must at least hold, and as what; anything else is not understood.
 * @type {{[Kind in Message['kind']]: Partial<Record<keyof Extract<Message, {kind: Kind}>, string>>}}
 */
const SHAPES = {
  hello: { boot: 'string', time_ms: 'number' },
  offer: { seq: 'number' },
  state: {
    server: 'object', session: 'object', link: 'object', signals: 'object', nearest: 'object', checks: 'array',
    alarms: 'array', limits: 'object', recording: 'object', decelerate: 'object', control: 'object',
  },
  cars: { time_ms: 'number', cars: 'array' },
  events: { events: 'array' },
  reply: { id: 'string', ok: 'boolean' },
  problem: { reason: 'string' },
  unserved: { why: 'string' },
  duty: { signs: 'string', people: 'number', on_duty: 'array' },
  fleet_event: { vehicle: 'string', n: 'number', time_ms: 'number', text: 'string' },
  timeline: { length_s: 'number', bucket_s: 'number', speed_mps: 'array', gaps: 'array', marks: 'array', notes: 'array' },
  beside: { replay: 'object', state: 'object', notes: 'array' },
  beside_ended: { ended: 'string' },
  replay: { ended: 'string' },
};

/**
 * The message in a text frame, or null where it is none of ours: a frame that cannot be read must never stop the page.
 * @param {string} text
 * @returns {Message | null}
 */
export function readMessage(text) {
  let message;
  try {
    message = JSON.parse(text);
  } catch {
    return null;
  }
  if (message === null || typeof message !== 'object') return null;
  const shape = Object.hasOwn(SHAPES, message.kind) ? SHAPES[/** @type {Message['kind']} */ (message.kind)] : undefined;
  if (!shape) return null;
  for (const [name, kind] of Object.entries(shape)) {
    const value = message[name];
    const is = Array.isArray(value) ? 'array' : value === null ? 'null' : typeof value;
    if (is !== kind) return null;
  }
  try {
    return understood(message);
  } catch {
    return null; // what is inside is not of its type
  }
}
