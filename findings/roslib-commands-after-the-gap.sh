#!/bin/sh
# roslib 2.1.0 with ws 8.18.0 (npm, Node.js 20), and roslibpy 2.1.0 with websockets 15.0.1 (PyPI).
#
# What a good engineer would guess: `publish` on a lost connection fails, or what it should send is gone. The protocol is
# one of live topics, and `ros.isConnected` is false.
#
# What is seen: both libraries keep what is published without a connection, and report nothing. With the next connection
# all of it is sent at once, in order. Orders to drive of the time of a radio gap reach the car when the gap is over, and
# the newest one comes last. roslibpy even sends them before it advertises the topic again. A program must test the
# connection before each `publish`.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 2
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check roslibpy==2.1.0 websockets==15.0.1 || exit 2
cd "$folder"
npm init --yes > /dev/null || exit 2
npm install --silent roslib@2.1.0 ws@8.18.0 > /dev/null || exit 2

cat > try.mjs <<'NODE'
import { readFileSync } from 'node:fs'
import * as roslib from 'roslib'
import { WebSocketServer } from 'ws'

const sockets = []
const operations = [] // [connection, operation, speed]
const bridge = new WebSocketServer({ port: 0 })
await new Promise((resolve) => bridge.once('listening', resolve))
bridge.on('connection', (socket) => {
  const number = sockets.push(socket)
  socket.on('message', (text) => {
    const { op, msg } = JSON.parse(text)
    operations.push([number, op, msg ? msg.linear.x : null])
  })
})
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms))
const until = async (done) => {
  for (let round = 0; round < 100 && !done(); round += 1) await pause(100)
}

const url = `ws://127.0.0.1:${bridge.address().port}`
const ros = new roslib.Ros()
let closed = false
ros.on('close', () => (closed = true))
await ros.connect(url)
const order = new roslib.Topic({ ros, name: '/cmd_vel', messageType: 'geometry_msgs/Twist' })
order.publish({ linear: { x: 0 } })
await until(() => operations.length === 2)
sockets[0].close()
await until(() => closed)
for (const x of [1, 2, 3]) order.publish({ linear: { x } })
await pause(2000)
await ros.connect(url)
await until(() => operations.length >= 6)

const { version } = JSON.parse(readFileSync('node_modules/roslib/package.json', 'utf8'))
const late = operations.filter(([number, op]) => number === 2 && op === 'publish').map(([, , speed]) => speed)
console.log(`roslib ${version}, published 2 s before the next connection: 1, 2, 3`)
console.log(`  sent on the next connection: ${late.join(', ') || 'nothing'}`)
process.exit(late.join() === '1,2,3' ? 0 : 1)
NODE

cat > try.py <<'PYTHON'
import asyncio
import json
import os
import threading
import time
from importlib.metadata import version

import roslibpy
import websockets

sockets, operations, ports = [], [], []
loop = asyncio.new_event_loop()


async def serve_one(socket):
    sockets.append(socket)
    number = len(sockets)
    async for text in socket:
        operation = json.loads(text)
        operations.append((number, operation["op"], operation.get("msg", {}).get("linear", {}).get("x")))


async def serve():
    server = await websockets.serve(serve_one, "127.0.0.1", 0)
    ports.append(server.sockets[0].getsockname()[1])
    await asyncio.Future()


def until(done):
    for _ in range(200):
        if done():
            return
        time.sleep(0.1)


threading.Thread(target=loop.run_until_complete, args=(serve(),), daemon=True).start()
until(lambda: ports)
ros = roslibpy.Ros("127.0.0.1", ports[0])
ros.run()
order = roslibpy.Topic(ros, "/cmd_vel", "geometry_msgs/Twist")
order.publish({"linear": {"x": 0.0}})
until(lambda: len(operations) == 2)
asyncio.run_coroutine_threadsafe(sockets[0].close(), loop)
until(lambda: not ros.is_connected)
for speed in (1.0, 2.0, 3.0):
    order.publish({"linear": {"x": speed}})
until(lambda: len(operations) >= 6)

late = [(op, speed) for number, op, speed in operations if number == 2]
print(f"roslibpy {version('roslibpy')}, published without a connection: 1.0, 2.0, 3.0")
print("  sent on the next connection: " + ", ".join(op if speed is None else f"{op} {speed}" for op, speed in late))
holds = [speed for _, speed in late[:3]] == [1.0, 2.0, 3.0] and ("advertise", None) in late[3:]
print(end="", flush=True)
os._exit(0 if holds else 1)
PYTHON

status=0
timeout 60 node try.mjs || status=1
timeout 60 "$folder/venv/bin/python" -u try.py || status=1
[ "$status" = 0 ] && echo "The behaviour holds." || echo "The behaviour has changed."
exit "$status"
