"""The processor first, while commands are spoken: a busy machine must not make them uneven.

Where all processors are busy, a process that slept gets one some milliseconds after it is due. Under a real-time policy
(SCHED_RR, sched(7)) it gets it at once. What it takes is bounded by the system itself (95 % of a second,
/proc/sys/kernel/sched_rt_runtime_us), so that a loop gone wrong does not lock the machine.
"""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Iterator

log = logging.getLogger("catgraph.slowing")

PRIORITY = 10  # of 1 … 99: before all that is ordinary, behind what the system itself holds for urgent


class Urgency:
    """One thread's. Several vehicles may be slowed from it at once: the last one to end gives the processor back."""

    def __init__(self) -> None:
        self._holders = 0
        self._before: tuple[int, int] | None = None  # policy and priority; None: they are not changed
        self._told = False

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Within the block the calling thread goes before all ordinary ones, where the system lets it. A process or a
        thread that it starts meanwhile is ordinary."""
        self._holders += 1
        if self._holders == 1:
            self._raise()
        try:
            yield
        finally:
            self._holders -= 1
            if self._holders == 0:
                self._give_back()

    def _raise(self) -> None:
        if not hasattr(os, "sched_setscheduler"):  # not Linux
            return
        try:
            before = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
            os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
        except OSError as why:  # no right to it, or a system that does not know it
            if not self._told:
                self._told = True
                log.warning(
                    "commands are spoken at ordinary priority, the system allows no other (CAP_SYS_NICE): %s", why
                )
            return
        self._before = before

    def _give_back(self) -> None:
        if self._before is not None:
            (policy, priority), self._before = self._before, None
            try:  # who was let by RLIMIT_RTPRIO alone may not take the second flag back
                os.sched_setscheduler(0, policy | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
            except OSError:  # the commands have ended all the same
                log.exception("the server keeps its real-time priority")
