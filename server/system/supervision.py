"""Tasks that must not end while their owner lives: whatever ends one is logged, counted, and the task starts again.

A task is watched by its done callback, not by another task around it: a cancellation that reaches every task of the
loop cannot take the supervision with it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection, Coroutine
from dataclasses import dataclass
from typing import Any

log = logging.getLogger("catgraph.supervision")

FIRST_RESTART_S = 0.02
LAST_RESTART_S = 1.0
RESTART_GROWTH = 2.0
STEADY_S = 5.0  # a task that ran this long starts again without delay
CANCEL_AGAIN_S = 0.5  # asyncio.wait_for of Python 3.11 may swallow a cancellation
RECENT_S = 60.0  # a restart counts as a problem this long

Work = Callable[[], Coroutine[Any, Any, None]]


@dataclass(slots=True)
class _Kept:
    """One supervised task."""

    work: Work
    may_end: bool
    task: asyncio.Task[None] | None = None
    started_s: float = 0.0
    delay_s: float = FIRST_RESTART_S
    restarts: int = 0
    restarted_s: float | None = None  # the newest restart, by the loop's clock
    why: str = ""
    timer: asyncio.TimerHandle | None = None


class Supervisor:
    """Starts tasks on the running loop and starts them again until `stop`.

    `on_restart(name, why)` is called at each restart; what it raises is logged.
    """

    def __init__(self, owner: str, *, on_restart: Callable[[str, str], None] = lambda name, why: None) -> None:
        self._owner = owner
        self._on_restart = on_restart
        self._kept: dict[str, _Kept] = {}
        self._is_stopping = False

    def keep(self, name: str, work: Work, *, may_end: bool = False) -> None:
        """Runs `work()` as the task `name`; a task of that name that still runs is replaced.

        Any end of it, by an exception, a cancellation or a return, starts it again. With `may_end` a return is its end.
        """
        self.end(name)
        kept = self._kept[name] = _Kept(work=work, may_end=may_end)
        self._start(name, kept)

    def end(self, name: str) -> None:
        """Ends one task for good; a name that is not kept is ignored."""
        kept = self._kept.pop(name, None)
        if kept is None:
            return
        if kept.timer is not None:
            kept.timer.cancel()
        if kept.task is not None:
            kept.task.cancel()

    async def stop(self) -> None:
        """Cancels every task and waits for its end."""
        self._is_stopping = True
        tasks = {kept.task for kept in self._kept.values() if kept.task is not None}
        for name in list(self._kept):
            self.end(name)
        await cancel(tasks)

    def keeps(self, name: str) -> bool:
        """Whether a task of that name is supervised."""
        return name in self._kept

    @property
    def restarts(self) -> dict[str, int]:
        """How often each task was started again."""
        return {name: kept.restarts for name, kept in self._kept.items()}

    def problems(self) -> list[str]:
        """The tasks that do not run now or were started again within the last minute, a sentence each."""
        now_s = asyncio.get_running_loop().time()
        found = []
        for name, kept in self._kept.items():
            if kept.task is None or kept.task.done():
                found.append(f"The task “{name}” is not running: {kept.why}.")
            elif kept.restarted_s is not None and now_s - kept.restarted_s < RECENT_S:
                found.append(f"The task “{name}” failed and was restarted: {kept.why}.")
        return found

    def _start(self, name: str, kept: _Kept) -> None:
        loop = asyncio.get_running_loop()
        kept.timer = None
        kept.started_s = loop.time()
        kept.task = loop.create_task(kept.work(), name=f"{self._owner} {name}")
        kept.task.add_done_callback(lambda task: self._ended(name, kept, task))

    def _ended(self, name: str, kept: _Kept, task: asyncio.Task[None]) -> None:
        error = None if task.cancelled() else task.exception()
        if self._is_stopping or self._kept.get(name) is not kept:
            if error is not None:
                log.error("task failed while stopping: owner=%s task=%s", self._owner, name, exc_info=error)
            return
        if task.cancelled():
            kept.why = "it was cancelled"
        elif error is not None:
            kept.why = f"{type(error).__name__}: {error}"[:200]
        elif kept.may_end:
            del self._kept[name]
            return
        else:
            kept.why = "it returned"
        log.error("task ended, restarting: owner=%s task=%s why=%s", self._owner, name, kept.why, exc_info=error)
        loop = task.get_loop()
        if loop.time() - kept.started_s >= STEADY_S:
            kept.delay_s = FIRST_RESTART_S
        kept.timer = loop.call_later(kept.delay_s, self._restart, name, kept)
        kept.delay_s = min(kept.delay_s * RESTART_GROWTH, LAST_RESTART_S)

    def _restart(self, name: str, kept: _Kept) -> None:
        kept.restarts += 1
        kept.restarted_s = asyncio.get_running_loop().time()
        self._start(name, kept)
        try:
            self._on_restart(name, kept.why)
        except Exception:  # the log of restarts may fail; the restart has happened
            log.exception("task restart not reported: owner=%s task=%s", self._owner, name)


async def cancel(tasks: Collection[asyncio.Task[None]]) -> None:
    """Returns once all of these have ended."""
    left = set(tasks)
    while left:
        for task in left:
            task.cancel()
        _, left = await asyncio.wait(left, timeout=CANCEL_AGAIN_S)
