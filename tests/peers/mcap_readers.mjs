// What @mcap/core finds in a recording: forward as a stream, by its index, and backward. Usage: node mcap_readers.mjs FILE
import { open } from 'node:fs/promises';

import zstd from '@foxglove/wasm-zstd';
import { McapIndexedReader, McapStreamReader } from '@mcap/core';

await zstd.isLoaded;
const decompressHandlers = { zstd: (data, size) => zstd.decompress(data, Number(size)) };
const file = await open(process.argv[2], 'r');
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, length) => {
    const buffer = new Uint8Array(Number(length));
    const { bytesRead } = await file.read(buffer, 0, buffer.length, Number(offset));
    if (bytesRead !== buffer.length) throw new Error('The file ends too early');
    return buffer;
  },
};

/** Messages of each topic, and whether their times only grow, or only fall. */
const counted = () => ({ topics: {}, grows: true, falls: true, last: undefined });
function note(found, topic, { logTime }) {
  found.topics[topic] = (found.topics[topic] ?? 0) + 1;
  if (found.last !== undefined) {
    found.grows &&= logTime >= found.last;
    found.falls &&= logTime <= found.last;
  }
  found.last = logTime;
}

const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
stream.append(await readable.read(0n, await readable.size()));
const forward = counted();
const channels = new Map();
const records = {};
for (let record; (record = stream.nextRecord()); ) {
  records[record.type] = (records[record.type] ?? 0) + 1;
  if (record.type === 'Channel') channels.set(record.id, record.topic);
  if (record.type === 'Message') note(forward, channels.get(record.channelId), record);
}

const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const [indexed, backward] = [counted(), counted()];
for await (const message of reader.readMessages()) note(indexed, reader.channelsById.get(message.channelId).topic, message);
for await (const message of reader.readMessages({ reverse: true })) note(backward, reader.channelsById.get(message.channelId).topic, message);
let attachments = 0;
for await (const _ of reader.readAttachments()) attachments += 1;
const found = { forward, indexed, backward, records, attachments, isDone: stream.done() };
process.stdout.write(JSON.stringify(found, (_, value) => (typeof value === 'bigint' ? String(value) : value)));
await file.close();
