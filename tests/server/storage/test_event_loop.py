"""The event loop waits for no disk: a server at its usual work uses files from other threads only."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.server.storage import usual_work

# What the event loop may do with a disk, by the function that does it.
ALLOWED = {
    "fastapi/routing.py:_extract_endpoint_context": "reads where an endpoint stands at its first request, "
    "from files of the installation; FastAPI has no switch for it",
}


def accesses(watched: Path) -> list[dict[str, Any]]:
    """What the event loop did with a disk and may not do."""
    found = [json.loads(line) for line in watched.read_text().splitlines()]
    return [one for one in found if not any(caller.endswith(tuple(ALLOWED)) for caller in one["by"])]


def described(one: dict[str, Any]) -> str:
    own = [caller for caller in one["by"] if caller.startswith(("server/", "monitor/"))]
    return f"{one['call']}({one['what']}) in {' < '.join(reversed(own or one['by']))}"


@pytest.mark.field
@pytest.mark.slow
@pytest.mark.timeout(180)
async def test_usual_work_opens_no_file_on_the_event_loop(tmp_path: Path) -> None:
    """From the first answer to the end of the process."""
    watched = tmp_path / "watched"
    module = "tests.server.storage.watched_server"
    server = usual_work.Process(tmp_path, module=module, CATGRAPH_WATCHED=str(watched))
    try:
        base = await server.address()
        async with usual_work.paired(base, "First") as phone:  # who is answered shows that the start is over
            await phone.ask("GET", "/api/health")
        server.begin_watch()
        await usual_work.do_all(base, tmp_path)
        server.end()
    finally:
        server.kill()
    found = accesses(watched)
    assert not found, "\n".join(dict.fromkeys(map(described, found)))
    assert any("_extract_endpoint_context" in line for line in watched.read_text().splitlines()), "it watched"
