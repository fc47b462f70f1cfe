"""Runs a test on both event loops: asyncio's own, in its debug mode, and uvloop, under which the server runs."""

from __future__ import annotations

import asyncio
import functools
import inspect
from collections.abc import Callable, Coroutine
from typing import Any

import pytest
import uvloop

LOOPS: dict[str, Callable[[], asyncio.AbstractEventLoop]] = {
    "asyncio": asyncio.new_event_loop,
    "uvloop": uvloop.new_event_loop,
}


def on_both_loops(story: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Stands nearest to the test, below its parameters."""

    @functools.wraps(story)
    def test(new_loop: Callable[[], asyncio.AbstractEventLoop], **given: Any) -> None:
        with asyncio.Runner(debug=new_loop is asyncio.new_event_loop, loop_factory=new_loop) as runner:
            runner.run(story(**given))

    kinds = inspect.signature(story).parameters
    loop = inspect.Parameter("new_loop", inspect.Parameter.KEYWORD_ONLY)
    test.__signature__ = inspect.Signature([*kinds.values(), loop])  # type: ignore[attr-defined]
    both: Callable[..., None] = pytest.mark.parametrize("new_loop", LOOPS.values(), ids=LOOPS)(test)
    return both
