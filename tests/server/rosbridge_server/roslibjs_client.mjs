// Unmodified roslibjs under Node: node roslibjs_client.mjs PORT prints what it got as JSON.
import { Ros, Service, Topic } from "roslib";

const port = process.argv[2];
const ros = new Ros();
const statuses = [];
ros.on("error", (error) => fail(`connection: ${error}`));
const emit = ros.emit.bind(ros);
ros.emit = (event, ...what) => {
  if (event.startsWith("status:")) statuses.push(what[0]); // roslibjs names the event after the id, which it keeps
  return emit(event, ...what);
};

function fail(why) {
  console.error(why);
  process.exit(1);
}
setTimeout(() => fail("the bridge did not send what was expected"), 15_000).unref();

function take(name, messageType, count, options = {}) {
  return new Promise((resolve) => {
    const received = [];
    const topic = new Topic({ ros, name, messageType, ...options });
    topic.subscribe((message) => {
      received.push(message);
      if (received.length === count) {
        topic.unsubscribe();
        resolve(received);
      }
    });
  });
}

const ask = (method, ...args) => new Promise((resolve, reject) => ros[method](...args, resolve, reject));

await ros.connect(`ws://127.0.0.1:${port}`);
await new Promise((resolve) => (ros.isConnected ? resolve() : ros.on("connection", resolve)));

const hearing = Promise.all([
  take("/vel", "geometry_msgs/Twist", 20, { queue_length: 1 }),
  take("/scan", "sensor_msgs/LaserScan", 1),
  take("/echo", "std_msgs/String", 1),
  take("/points", "sensor_msgs/LaserScan", 3, { compression: "cbor", throttle_rate: 1 }),
]);
const command = new Topic({ ros, name: "/cmd_vel", messageType: "geometry_msgs/Twist" });
command.advertise();
command.publish({ linear: { x: 1.5, y: 0, z: 0 }, angular: { x: 0, y: 0, z: 0 } });
const [velocities, [scan], [echo], points] = await hearing;

const add = new Service({ ros, name: "/add", serviceType: "demo/Add" });
const sum = await new Promise((resolve, reject) => add.callService({ a: 2, b: 3 }, resolve, reject));
const none = new Service({ ros, name: "/rosapi/not_there", serviceType: "rosapi/GetParam" });
const failure = await new Promise((resolve) => none.callService({ name: "/x" }, () => resolve(null), resolve));
const details = await ask("getMessageDetails", "geometry_msgs/Twist");
const wrong = new Topic({ ros, name: "/vel", messageType: "std_msgs/Float64" });
wrong.subscribe(() => fail("data of the wrong type"));
await new Promise((resolve) => setTimeout(resolve, 100));

process.stdout.write(
  JSON.stringify({
    velocities: velocities.map((message) => message.linear.x),
    scan,
    echo,
    points: Array.from(points[0].ranges, (range) => (Number.isFinite(range) ? range : String(range))),
    pointsKind: points[0].ranges.constructor.name,
    topics: (await ask("getTopics")).topics.sort(),
    type: await ask("getTopicType", "/scan"),
    nodes: await ask("getNodes"),
    services: (await ask("getServices")).includes("/rosapi/topics"),
    details: ros.decodeTypeDefs(details),
    sum: sum.sum,
    failure,
    statuses: statuses.map((status) => status.msg),
  }),
  () => process.exit(0),
);
