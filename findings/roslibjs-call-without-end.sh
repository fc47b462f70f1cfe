#!/bin/sh
# roslib 2.1.0 with ws 8.18.0 (npm, Node.js 20).
#
# What a good engineer would guess: a service call whose connection closes before the answer came fails: the callback
# for errors is called.
#
# What is seen: neither callback is called, with the connection closed and 5 s after the next one is open. A page that
# waits for the answer to its call has to end the wait itself.
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

// The part of a rosbridge that is needed here: it answers the calls of its second connection.
const calls = []
const sockets = []
const bridge = new WebSocketServer({ port: 0 })
await new Promise((resolve) => bridge.once('listening', resolve))
bridge.on('connection', (socket) => {
  sockets.push(socket)
  socket.on('message', (text) => {
    const { op, id, service } = JSON.parse(text)
    calls.push(op)
    if (sockets.length > 1) socket.send(JSON.stringify({ op: 'service_response', id, service, values: {}, result: true }))
  })
})
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms))
const until = async (done) => {
  for (let round = 0; round < 100 && !done(); round += 1) await pause(100)
}

const url = `ws://127.0.0.1:${bridge.address().port}`
const ros = new roslib.Ros()
await ros.connect(url)
await until(() => sockets.length === 1)
const service = new roslib.Service({ ros, name: '/stop', serviceType: 'std_srvs/Trigger' })
const call = () => {
  const one = { end: 'no answer' }
  service.callService({}, () => (one.end = 'answered'), (error) => (one.end = `failed: ${error}`))
  return one
}

let closed = false
ros.on('close', () => (closed = true))
const before = call()
await until(() => calls.length === 1)
sockets[0].close()
await until(() => closed)
await ros.connect(url)
await until(() => sockets.length === 2)
const after = call()
await until(() => after.end !== 'no answer')
await pause(5000)

const { version } = JSON.parse(readFileSync('node_modules/roslib/package.json', 'utf8'))
console.log(`roslib ${version}`)
console.log(`  call before the connection closed: ${before.end}`)
console.log(`  call on the next connection:       ${after.end}`)
const holds = before.end === 'no answer' && after.end === 'answered'
console.log(holds ? 'The behaviour holds.' : 'The behaviour has changed.')
process.exit(holds ? 0 : 1)
NODE

status=0
timeout 60 node try.mjs || status=$?
exit "$status"
