"""The address of the page's socket."""

from __future__ import annotations

from fastapi import APIRouter, WebSocket

from server.access.identity import principal_of
from server.protocol import replay_commands
from server.protocol.messages import Hello, RoleName
from server.web.services import services

router = APIRouter()


@router.websocket("/ws")
async def page_socket(
    socket: WebSocket, vehicle: str | None = None, replay: str | None = None, t: str | None = None
) -> None:
    """The page's socket; docs/protocol.md. `replay`: the recording it begins with, `t` seconds after its beginning."""
    app = services(socket)
    name = vehicle if vehicle is not None else next(iter(app.sessions))
    if name not in app.sessions:
        await socket.close(code=1008, reason="no such vehicle")
        return
    principal = principal_of(socket)
    role: RoleName = "operator" if principal.is_operator else "viewer"
    hello: Hello = {**app.hello(name), "who": {"id": principal.id, "name": principal.name, "role": role}}
    await app.hub.serve(socket, name, hello, principal=principal, replay=replay_commands.opening(replay, t))
