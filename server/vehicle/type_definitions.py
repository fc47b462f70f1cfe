"""Learns from rosapi how the types of a car are defined: recordings need it, and so does the choice of CBOR."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

from server.judge.message import RosVersion
from server.rosbridge.link_errors import CallFailed, LinkDown
from server.rosbridge.rosapi_client import Asks
from server.vehicle import discovery
from server.vehicle.encoding_choice import fit_for_cbor

log = logging.getLogger("catgraph.subscriptions")

LEARN_TRIES = 3  # of rosapi's call for all definitions, which may take it long


class TypeDefinitions:
    """Of one car. Learning runs beside everything else: it may take long, and proves nothing.

    `learned(definitions)` is called with type → definition as they come, `changed()` after each answer.
    """

    def __init__(self, learned: Callable[[Mapping[str, str]], None], changed: Callable[[], None]) -> None:
        self._learned = learned
        self._changed = changed
        self._unanswered: set[str] = set()  # fetched without an answer of rosapi
        self._tries = 0
        self._task: asyncio.Task[None] | None = None
        self._ended = False
        self.asked: set[str] = set()  # types whose definitions were requested
        self.fit: set[str] = set()  # of those, the ones that arrive as CBOR
        self.may_be_large: set[str] = set()  # types that have arrays without a bound

    def learn(self, asks: Asks, topics: Mapping[str, str], ros_version: int | None) -> None:
        """Start to fetch unknown type definitions of these topics; does nothing while a fetch runs."""
        if self._task is None:
            self._task = asyncio.create_task(self._ask(asks, topics, ros_version), name="definitions")
            self._task.add_done_callback(self._done)

    def end(self) -> None:
        """What is still answered is of no interest any more."""
        self._ended = True
        if self._task is not None:
            self._task.cancel()

    async def _ask(self, asks: Asks, topics: Mapping[str, str], ros_version: int | None) -> None:
        """Definitions come first: what is recorded before they are known is JSON."""
        types = {kind for kind in topics.values() if kind} - self.asked
        if self._tries < LEARN_TRIES:
            types |= self._unanswered
        if not types:
            return
        ros: RosVersion | None = 1 if ros_version == 1 else 2 if ros_version == 2 else None
        found: dict[str, str] = {}
        try:
            found = await discovery.fetch_definitions(asks, types, ros)
        except LinkDown:
            return
        except CallFailed as why:
            self._tries += 1
            self._unanswered |= types  # recorded with what is known, and fetched again
            log.warning("type definitions missing: count=%d types=%s", len(types), why)
        else:
            self._tries = 0
            self._unanswered.clear()
        fit = await asyncio.to_thread(fit_for_cbor, types, found, ros)
        if not self._ended:
            self.asked |= types
            self.fit |= fit
            self.may_be_large |= {kind for kind in types if kind not in found or "[]" in found[kind]}
            if found:
                self._learned(found)
            self._changed()

    def _done(self, task: asyncio.Task[None]) -> None:
        self._task = None
        if not task.cancelled() and task.exception() is not None:
            log.error("type definitions not learned", exc_info=task.exception())
