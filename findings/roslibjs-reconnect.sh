#!/bin/sh
# roslib 2.1.0 with ws 8.18.0 (npm, Node.js 20).
#
# What a good engineer would guess: after `ros.connect()` on a new connection, with `reconnect_on_close` (the default),
# all that was asked of the bridge holds again: subscriptions, advertised topics and provided services. roslibpy, the
# same library for Python, provides its services again.
#
# What is seen: a `Topic` repeats one operation only, the one that it did first. An object that subscribed and then
# advertised is not advertised again, one that advertised first is not subscribed again, and `isAdvertised` is true for
# both. A provided `Service` is not advertised again at all. No event says so.
#
# Exit code: 0 while this behaviour holds, 1 once it changed, 2 where it could not be tried.
set -eu

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm init --yes > /dev/null || exit 2
npm install --silent roslib@2.1.0 ws@8.18.0 > /dev/null || exit 2

cat > try.mjs <<'NODE'
import { readFileSync } from 'node:fs'
import * as roslib from 'roslib'
import { WebSocketServer } from 'ws'

// The part of a rosbridge that is needed here: it notes what each connection is sent.
const sent = []
const sockets = []
const bridge = new WebSocketServer({ port: 0 })
await new Promise((resolve) => bridge.once('listening', resolve))
bridge.on('connection', (socket) => {
  const list = []
  sent.push(list)
  sockets.push(socket)
  socket.on('message', (text) => {
    const message = JSON.parse(text)
    list.push(`${message.op} ${message.topic ?? message.service}`)
  })
})
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms))
const until = async (done) => {
  for (let round = 0; round < 100 && !done(); round += 1) await pause(100)
}

const url = `ws://127.0.0.1:${bridge.address().port}`
const ros = new roslib.Ros()
ros.on('close', () => setTimeout(() => ros.connect(url), 200))
await ros.connect(url)
await until(() => sockets.length === 1)

const topic = (name) => new roslib.Topic({ ros, name, messageType: 'std_msgs/Float64' })
const first = topic('/subscribed_first')
first.subscribe(() => {})
first.advertise()
const second = topic('/advertised_first')
second.advertise()
second.subscribe(() => {})
new roslib.Service({ ros, name: '/service', serviceType: 'std_srvs/Trigger' }).advertise(() => true)
await until(() => sent[0].length === 5)

sockets[0].close()
await until(() => sent.length === 2 && sent[1].length >= 2)
await pause(3000)

const { version } = JSON.parse(readFileSync('node_modules/roslib/package.json', 'utf8'))
console.log(`roslib ${version}`)
console.log('  first connection: ', sent[0])
console.log('  second connection:', sent[1])
console.log(`  isAdvertised: ${first.isAdvertised} and ${second.isAdvertised}`)
const expected = ['advertise /advertised_first', 'subscribe /subscribed_first']
const holds = JSON.stringify([...sent[1]].sort()) === JSON.stringify(expected) && first.isAdvertised && second.isAdvertised
console.log(holds ? 'The behaviour holds.' : 'The behaviour has changed.')
process.exit(holds ? 0 : 1)
NODE

status=0
timeout 60 node try.mjs || status=$?
exit "$status"
