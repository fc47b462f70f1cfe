// Foxglove's reader of ROS 1 bags: of each topic its type, how many messages, the first three and the last, as JSON.
// Usage: node rosbag_reader.mjs FILE
import { Bag } from '@foxglove/rosbag';
import { FileReader } from '@foxglove/rosbag/node.js';
import { parse } from '@foxglove/rosmsg';
import { MessageReader } from '@foxglove/rosmsg-serialization';
import bzip2 from '@foxglove/wasm-bz2';
import lz4 from '@foxglove/wasm-lz4';

await lz4.isLoaded;
const bz2 = await bzip2.init();
const decompress = {
  bz2: (data, size) => bz2.decompress(data, size, { small: false }),
  lz4: (data, size) => lz4(data, size),
};
const bag = new Bag(new FileReader(process.argv[2]), { decompress, parse: false });
await bag.open();
const readers = new Map();
const topics = {};
for (const { conn, topic, type, messageDefinition } of bag.connections.values()) {
  readers.set(conn, new MessageReader(parse(messageDefinition)));
  topics[topic] ??= { type, count: 0, first: [], last: null };
}
for await (const { connectionId, topic, data } of bag.messageIterator()) {
  const row = topics[topic];
  row.last = readers.get(connectionId).readMessage(data);
  row.count += 1;
  if (row.first.length < 3) row.first.push(row.last);
}
const plain = (_, value) => (typeof value === 'bigint' ? Number(value) : ArrayBuffer.isView(value) ? Array.from(value) : value);
process.stdout.write(JSON.stringify({ topics }, plain), () => process.exit(0));
