"""What is known of the server of one connection."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any

from server.rosbridge.link_errors import CallFailed, LinkDown
from server.vehicle.foxglove.channels import Offered
from server.vehicle.foxglove.commands import Commands
from server.vehicle.foxglove.protocol import ServerInfo

GRAPH = "connectionGraph"
FIRST_CHANNELS_S = 0.5  # after it has named itself, a server names what it offers


class ServerState:
    """To be used on one event loop."""

    def __init__(self) -> None:
        self.offered = Offered()
        self.commands: Commands | None = None
        self._is_known = asyncio.Event()
        self._timer: asyncio.TimerHandle | None = None

    def introduced(self, info: ServerInfo) -> bool:
        """A server named itself, for the first time or with another session: what it offers stays. Whether its nodes
        are to be asked for."""
        if self.commands is None:
            self.commands = Commands(info)
            self._timer = asyncio.get_running_loop().call_later(FIRST_CHANNELS_S, self._is_known.set)
        self.commands.info = info
        before, self.offered.has_graph = self.offered.has_graph, GRAPH in info.capabilities
        return self.offered.has_graph and not before

    def advertised(self) -> None:
        """Channels were offered."""
        if self.commands is not None:
            self._is_known.set()

    def end(self) -> None:
        """The connection ended."""
        if self._timer is not None:
            self._timer.cancel()

    @property
    def command_problem(self) -> str | None:
        """Why no command can be sent; None: it can, or it is not known yet."""
        return None if self.commands is None else self.commands.problem(self.offered.encodings())

    def command(self, operation: dict[str, Any]) -> tuple[bytes, bool]:
        """The frame of a command, and whether it is binary. Raises LinkDown, NotAllowed."""
        if self.commands is None:
            raise LinkDown("not sent: the Foxglove server has not listed its capabilities yet")
        frame = self.commands.frames(operation, self.offered.encodings())
        match operation["op"]:
            case "advertise":
                self.offered.announced(operation["topic"])
            case "unadvertise":
                self.offered.withdrawn(operation["topic"])
        return frame

    async def answer(self, service: str, arguments: Mapping[str, Any], timeout_s: float) -> dict[str, Any]:
        """As rosapi answers. Raises CallFailed."""
        try:
            async with asyncio.timeout(timeout_s):
                await self._is_known.wait()
        except TimeoutError:
            raise CallFailed("the Foxglove server has not listed its channels") from None
        return self.offered.answer(service, arguments)
