"""Which requests are for what an agent keeps: declared once, for the node that carries them and for the agent."""

from __future__ import annotations

import re
from collections.abc import MutableMapping
from typing import Any

from starlette.routing import Match

from server.web.routes import exports, logbook, mail, marks, recorded_marks, recordings, stored

ROUTERS = (
    exports.router,
    recordings.router,
    logbook.router,
    stored.copies,
    mail.router,
    marks.kept,
    recorded_marks.router,
)
REPLAYS = "/kept/replays"  # only between a node and an agent: no server has it among its own routes
_AT_AGENT = re.compile(r"(/agents/([^/]{1,40}))(/api/.*)", re.DOTALL)

REQUEST_HEADERS = frozenset(
    {"accept", "content-type", "host", "if-none-match", "if-range", "range", "user-agent", "x-catgraph-name"}
)
ANSWER_HEADERS = frozenset(
    {
        *("accept-ranges", "allow", "cache-control", "catgraph-not-whole", "content-disposition", "content-length"),
        *("content-range", "content-type", "etag", "last-modified", "retry-after"),
    }
)


def is_kept(scope: MutableMapping[str, Any], path: str) -> bool:
    """Whether an agent answers requests to this path."""
    at_agent = {**scope, "path": path, "root_path": ""}
    return any(route.matches(at_agent)[0] is not Match.NONE for router in ROUTERS for route in router.routes)


def split(path: str) -> tuple[str, str | None, str]:
    """The part before the agent's own path, the vehicle whose agent is meant, and the agent's own path."""
    found = _AT_AGENT.fullmatch(path)
    return ("", None, path) if found is None else (found[1], found[2], found[3])
