// roslibjs of npm at a rosbridge, as Foxglove's and Lichtblick's players use it: every topic, in one encoding, until the
// bridge closes. Usage: node bridge_client.mjs PORT none|cbor|png|cbor-raw
// With cbor-raw the messages are decoded by the players' own readers. Prints, as JSON, of each topic its type, how many
// messages came, the first three and the last.
import { MessageReader as Ros1Reader } from '@foxglove/rosmsg-serialization';
import { MessageReader as Ros2Reader } from '@foxglove/rosmsg2-serialization';
import { parse } from '@foxglove/rosmsg';
import { Ros, Topic } from 'roslib';

const FIRST = 3;
const [port, compression] = process.argv.slice(2);
const ros = new Ros();
const statuses = [];
const seen = {};
const emit = ros.emit.bind(ros);
ros.emit = (event, ...what) => {
  if (event.startsWith('status:')) statuses.push(what[0].msg);
  return emit(event, ...what);
};
ros.on('error', (error) => console.error(`connection: ${error}`));

const connected = new Promise((resolve) => ros.once('connection', resolve));
await ros.connect(`ws://127.0.0.1:${port}`);
if (!ros.isConnected) await connected;
const { topics, types, typedefs_full_text: definitions } = await new Promise((resolve, reject) => ros.getTopicsAndRawTypes(resolve, reject));
const isRos2 = types[topics.indexOf('/rosout')] === 'rcl_interfaces/msg/Log';

const readers = topics.map((_, index) => {
  if (compression !== 'cbor-raw') return (message) => message;
  const parsed = parse(definitions[index], { ros2: isRos2 });
  const reader = new (isRos2 ? Ros2Reader : Ros1Reader)(parsed);
  return ({ bytes }) => reader.readMessage(bytes);
});

const plain = (_, value) => {
  if (typeof value === 'bigint') return Number(value);
  return ArrayBuffer.isView(value) ? Array.from(value) : value;
};

ros.on('close', () => {
  const found = { isRos2, statuses, topics: seen };
  process.stdout.write(JSON.stringify(found, plain), () => process.exit(0));
});
topics.forEach((name, index) => {
  const row = { type: types[index], count: 0, first: [], last: null };
  seen[name] = row;
  new Topic({ ros, name, messageType: types[index], compression, reconnect_on_close: false }).subscribe((given) => {
    const message = readers[index](given);
    row.count += 1;
    row.last = message;
    if (row.first.length < FIRST) row.first.push(message);
  });
});
