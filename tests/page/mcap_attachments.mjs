// What Foxglove's own reader finds in a recording, as JSON: attachments, topics and the schemas of their channels.
// Usage: node mcap_attachments.mjs FILE
import { open } from 'node:fs/promises';

import { McapIndexedReader } from '@mcap/core';

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
const reader = await McapIndexedReader.Initialize({ readable });
const attachments = [];
for await (const { name, mediaType, data, logTime, createTime } of reader.readAttachments()) {
  const head = [...data.subarray(0, 4)];
  attachments.push({ name, mediaType, bytes: data.length, head, log_ms: Number(logTime / 1_000_000n), create_ms: Number(createTime / 1_000_000n) });
}
const schemas = Object.fromEntries([...reader.channelsById.values()].map(({ topic, schemaId }) => [topic, reader.schemasById.get(schemaId)?.name]));
console.log(JSON.stringify({ attachments, schemas, messages: Number(reader.statistics?.messageCount ?? 0n) }));
await file.close();
