"""How many replays there may be: one that takes the place of another, as after a choice, needs no further place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from server.replay.manager import NoReplay, ReplayClient, ReplayManager
from server.web.agents.at_agent import KeptReplays

MOST = 3


class Client(ReplayClient):
    async def close(self) -> None:
        pass


class Manager(ReplayManager):
    """Its replays have no processes."""

    def __init__(self) -> None:
        super().__init__(lambda _: None, now=lambda: 0.0, most=MOST)
        self.fails = False

    def _made(self, recording: str, opening: Mapping[str, Any], on_new: Any) -> ReplayClient:
        return Client(recording, now=self._now, on_new=on_new)

    async def _begin(self, client: ReplayClient, opening: Mapping[str, Any]) -> None:
        if self.fails:
            raise NoReplay("It cannot be read.")


async def opened(manager: Manager, instead: ReplayClient | None = None) -> ReplayClient:
    return await manager.open("drive", {}, on_new=lambda _: None, instead=instead)


async def test_the_last_place_is_judged_anew_as_often_as_it_is_asked() -> None:
    manager = Manager()
    clients = [await opened(manager) for _ in range(MOST)]
    for _ in range(4):
        client = await opened(manager, clients[0])
        await manager.close(clients[0])
        clients[0] = client
        with pytest.raises(NoReplay, match="3 replays are open already"):
            await opened(manager)
    assert manager.count == MOST


async def test_one_that_cannot_be_opened_leaves_the_other_and_gives_no_place() -> None:
    manager = Manager()
    clients = [await opened(manager) for _ in range(MOST)]
    manager.fails = True
    with pytest.raises(NoReplay, match="cannot be read"):
        await opened(manager, clients[0])
    assert manager.holds(clients[0].token)
    manager.fails = False
    with pytest.raises(NoReplay, match="3 replays are open already"):
        await opened(manager)


async def test_one_that_is_closed_already_gives_no_place() -> None:
    manager = Manager()
    clients = [await opened(manager) for _ in range(MOST)]
    await manager.close(clients[0])
    await opened(manager)
    with pytest.raises(NoReplay, match="3 replays are open already"):
        await opened(manager, clients[0])


async def test_at_an_agent_the_token_of_the_one_before_names_it() -> None:
    kept = KeptReplays(Manager())
    clients = [await kept.open("drive", {}) for _ in range(MOST)]
    for instead in ("", "nobody"):
        with pytest.raises(NoReplay, match="3 replays are open already"):
            await kept.open("drive", {}, instead)
    assert await kept.open("drive", {}, clients[1].token)
    for token in list(kept._shown):
        await kept.close(token)
