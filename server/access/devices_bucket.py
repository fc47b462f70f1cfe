"""The paired devices of all web nodes, in a key-value bucket of the broker (NATS JetStream).

https://docs.nats.io/nats-concepts/jetstream/key-value-store
"""

from __future__ import annotations

import asyncio
import contextlib
import logging

import nats.errors
from nats.aio.client import Client
from nats.js.api import KeyValueConfig
from nats.js.errors import KeyWrongLastSequenceError
from nats.js.kv import KeyValue

from server.access.shared_access import IDENTITY, BadEntry, SharedDevices

log = logging.getLogger("catgraph.access")

BUCKET = "catgraph_devices"  # broker_users.py lets nodes use it
CHECK_EVERY_S = 2.0  # whether all entries were received
AGAIN_S = 5.0


class DevicesBucket:
    """Keeps one node's devices and the bucket alike while there is a connection.

    Without the bucket, as at a broker without JetStream, the node uses the list that it has.
    """

    def __init__(self, shared: SharedDevices) -> None:
        self._shared = shared
        self._changed = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._logged = ""
        self.is_alike = False  # the bucket was read, and what this node has is in it

    def changed(self) -> None:
        """The list of this node was changed."""
        self._changed.set()

    def open(self) -> None:
        """Nothing is to be done without a connection."""

    def close(self) -> None:
        """Nothing is left behind."""

    async def start(self, client: Client) -> None:
        await self.stop()
        self._task = asyncio.create_task(self._run(client), name="shared devices")

    async def stop(self) -> None:
        self.is_alike = False
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
            self._task = None

    async def _run(self, client: Client) -> None:
        while True:
            try:
                await self._follow(client)
            except Exception as why:  # an error here neither admits nor refuses anybody
                self._complain(why)
            self.is_alike = False
            await asyncio.sleep(AGAIN_S)

    async def _follow(self, client: Client) -> None:
        """Until entries were missed. Raises the client's errors."""
        stream = client.jetstream(timeout=3)
        bucket = await stream.create_key_value(KeyValueConfig(bucket=BUCKET, history=1))
        with contextlib.suppress(KeyWrongLastSequenceError):  # another node was first
            await bucket.create(IDENTITY, self._shared.identity)
        self._shared.begin()
        watcher = await bucket.watchall()
        putting: asyncio.Task[None] | None = None
        newest, is_read = 0, False
        try:
            while True:
                try:
                    entry = await watcher.updates(timeout=CHECK_EVERY_S)  # type: ignore[no-untyped-call]
                except nats.errors.TimeoutError:
                    if putting is not None and putting.done():
                        putting.result()  # raises what it raised
                    if (await bucket.status()).stream_info.state.last_seq > newest:
                        return
                    continue
                if isinstance(entry, KeyValue.Entry):
                    newest = max(newest, entry.revision or 0)
                    self._take(entry)
                elif not is_read:  # all that was there
                    is_read = True
                    putting = asyncio.create_task(self._put(bucket), name="share devices")
        finally:
            if putting is not None:
                putting.cancel()
                await asyncio.gather(putting, return_exceptions=True)
            with contextlib.suppress(Exception):  # the broker may be gone
                await watcher.stop()  # type: ignore[no-untyped-call]

    def _take(self, entry: KeyValue.Entry) -> None:
        if entry.operation is not None or entry.value is None:
            return  # one that expired
        try:
            self._shared.take(entry.key, entry.value)
        except BadEntry as why:
            log.warning("shared_device_refused key=%s why=%s", entry.key[:80], why)

    async def _put(self, bucket: KeyValue) -> None:
        while True:
            self._changed.clear()
            for key in self._shared.outdated():
                await bucket.delete(key)
            for key, value in self._shared.due().items():
                await bucket.put(key, value)
            self.is_alike, self._logged = True, ""
            await self._changed.wait()

    def _complain(self, why: Exception) -> None:
        if (line := f"{type(why).__name__}: {why}".strip(": ")) != self._logged:
            self._logged = line
            log.warning("devices_not_shared why=%s: a device is known at this node only", line)
