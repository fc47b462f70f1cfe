"""A page without a browser: speaks docs/protocol.md over a real socket."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import time
from collections.abc import AsyncIterator, Callable
from typing import Any

import websockets

from server.access.order_signer import OrderSigner
from tests.frames import check_frame

WAIT_S = 60.0  # how long a test waits for what is to come: no test is about this limit


class Viewer:
    """Takes what it is offered and keeps it."""

    def __init__(
        self,
        socket: websockets.ClientConnection,
        *,
        takes: bool = True,
        name: str = "operator",
        page: str | None = None,
    ) -> None:
        self.socket = socket
        self.name = name
        self.page = page
        self.signer = OrderSigner()  # of its orders, where the server passes them on to agents
        self.takes = takes
        self.states: list[dict[str, Any]] = []
        self.scans: list[bytes] = []
        self.events: list[dict[str, Any]] = []
        self.resumed: dict[str, int] | None = None  # where another run went on
        self.offers: list[dict[str, Any]] = []
        self.other: list[dict[str, Any]] = []
        self.got_s: list[float] = []  # when each state came, wall clock
        self._ids = itertools.count(1)
        self._changed = asyncio.Condition()

    async def read(self) -> None:
        """Reads until the server ends it."""
        with contextlib.suppress(websockets.ConnectionClosed):
            async for message in self.socket:
                await self.hear(message)

    async def hear(self, message: str | bytes) -> None:
        """One frame, answered as a page answers."""
        if isinstance(message, bytes):
            self.scans.append(message)
        else:
            check_frame(message)
            frame = json.loads(message)
            match frame["kind"]:
                case "state":
                    self.states.append(frame)
                    self.got_s.append(time.time())
                case "offer":
                    self.offers.append(frame)
                    if self.takes:
                        await self.send({"kind": "take", "seq": frame["seq"]})
                case "events":
                    self.events.extend(frame["events"])
                    self.resumed = frame.get("resumed", self.resumed)
                    await self.send({"kind": "have", "event": frame["events"][-1]["n"] if frame["events"] else 0})
                case _:
                    self.other.append(frame)
        async with self._changed:
            self._changed.notify_all()

    async def send(self, message: dict[str, Any]) -> None:
        await self.socket.send(json.dumps(message))

    async def ask(self, *, within_s: float = WAIT_S, **command: Any) -> dict[str, Any]:
        """Sends a command and answers its reply."""
        identity = f"test {next(self._ids)}"
        await self.send(self.signed(command) | {"id": identity})
        return await self.until(lambda: next((r for r in self.other if r.get("id") == identity), None), within_s)

    @property
    def key(self) -> dict[str, Any]:
        """What a status names where orders are signed."""
        signs = any(one["kind"] == "hello" and one.get("signs") for one in self.other)
        return {"key": self.signer.id} if signs else {}

    def signed(self, command: dict[str, Any]) -> dict[str, Any]:
        """The command as a page of this server sends it."""
        vehicle = str(command.get("vehicle") or (self.states[-1]["vehicle"] if self.states else ""))
        challenge = self.challenge(vehicle)
        if not self.key or challenge is None:
            return command
        signed = self.signer.sign(command, vehicle=vehicle, by=self.name, challenge=challenge, page=self.page)
        return {"kind": command["kind"], "vehicle": vehicle, "signed": signed}

    def challenge(self, vehicle: str) -> str | None:
        """The newest of the agent of a car."""
        for one in reversed([*self.other, *self.states]):
            if one["kind"] == "state" and one["vehicle"] == vehicle:
                return str(one["server"].get("challenge") or "") or None
            listed = [car for car in one.get("cars", ()) if one["kind"] == "cars" and car["name"] == vehicle]
            if listed and listed[0]["summary"] is not None:
                return listed[0]["summary"].get("challenge")
        return None

    async def until(self, found: Callable[[], Any], within_s: float = WAIT_S) -> Any:
        """Waits for `found()` to be something and answers it."""
        async with asyncio.timeout(within_s), self._changed:
            while True:
                answer = found()
                if answer:
                    return answer
                await self._changed.wait()

    async def state(
        self, fits: Callable[[dict[str, Any]], bool] = lambda _: True, within_s: float = WAIT_S
    ) -> dict[str, Any]:
        """The next state (from now on) that fits."""
        start = len(self.states)
        found: dict[str, Any] = await self.until(
            lambda: next((state for state in self.states[start:] if fits(state)), None), within_s
        )
        return found


@contextlib.asynccontextmanager
async def viewer(
    base: str,
    *,
    vehicle: str | None = None,
    have_event: int | None = None,
    boot: str | None = None,
    name: str | None = None,
    page: str | None = None,
    fleet: bool = False,
    key: str | None = None,
) -> AsyncIterator[Viewer]:
    """A viewer that reads in the background; `base` is the server's http address. `boot`: the run that `have_event` is
    of. `fleet`: of all cars."""
    url = base.replace("http://", "ws://") + "/ws" + (f"?vehicle={vehicle}" if vehicle else "?fleet=1" if fleet else "")
    headers = {} if key is None else {"Authorization": f"Bearer {key}"}
    async with websockets.connect(url, max_size=2**24, additional_headers=headers) as socket:
        one = Viewer(socket, name=name or "operator", page=page)
        named = {key: value for key, value in (("name", name), ("page", page), ("boot", boot)) if value}
        await one.send({"kind": "hello", "have_event": have_event, "build": ""} | named)
        reading = asyncio.create_task(one.read())
        try:
            yield one
        finally:
            reading.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await reading
