"""The address of the page's socket."""

from __future__ import annotations

from functools import partial

from fastapi import APIRouter, WebSocket

from server.access.identity import principal_of
from server.protocol import replay_commands
from server.protocol.messages import Hello, Identity, RoleName
from server.web.services import services

router = APIRouter()


@router.websocket("/ws")
async def page_socket(
    socket: WebSocket,
    vehicle: str | None = None,
    replay: str | None = None,
    t: str | None = None,
    fleet: str | None = None,
) -> None:
    """The page's socket; docs/protocol.md. `replay`: the recording it begins with, `t` seconds after its beginning.
    `fleet` "1": of a page of all cars."""
    app = services(socket)
    principal = principal_of(socket)
    role: RoleName = "operator" if principal.is_operator else "viewer"
    name = vehicle if vehicle is not None else next(iter(app.vehicles), None)
    if fleet != "1" and (name is None or not app.may_be(name)):
        await socket.close(code=1008, reason="no such vehicle")
        return
    with app.access.next_ticket(principal) as ticket:

        def hello(name: str) -> Hello:
            who: Identity = {"id": principal.id, "name": principal.name, "role": role}
            return {**app.hello(name), "who": who, "ticket": ticket}

        if fleet == "1" or name is None:
            await app.hub.serve_fleet(socket, partial(hello, ""), principal=principal)
        else:
            opening = replay_commands.opening(replay, t)
            await app.hub.serve(socket, name, partial(hello, name), principal=principal, replay=opening)
