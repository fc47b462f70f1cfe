"""Questions to rosapi, on a connection of their own.

On ROS 2 a bridge answers the calls of one connection one after the other, and reads nothing else from it meanwhile: a
call that rosapi never answers would hold up every later subscription and every command of a slow-down. So questions
have their own connection, which may be held up, and is given up and dialled again when it is.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any, Protocol

from server.rosbridge.connection_errors import LOGIN_WANTED, Problem
from server.rosbridge.diagnosis import Diagnosis
from server.rosbridge.live_source import CallFailed, LinkDown, LiveSource, QuestionChannel, Refusal

GIVE_UP_S = 6.0  # a quick question that is so old will not be answered on this connection
GIVE_UP_LONG_S = 30.0  # the same of a question with a long answer, which a slow link takes long to carry
LONGEST_S = 120.0
FIRST_PAUSE_S = 4.0  # each connection that is given up may leave a thread in the bridge that waits for ever
LAST_PAUSE_S = 60.0
OPENS_WITHIN_S = 1.0
SIGNS_OF_LIFE = frozenset({"/rosapi/get_time", "/rosapi/topics"})  # on every rosapi, with a short answer


class ServiceCaller(Protocol):
    """Whatever can call a service of the bridge."""

    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any: ...


class _Silent:
    """The receiver of the connection for questions, on which only answers come."""

    def __init__(self) -> None:
        self.failed = False
        self.login: Problem | None = None  # the bridge wants one
        self.settled = asyncio.Event()  # opened, or failed to

    def link_opened(self) -> None:
        self.failed = False
        self.settled.set()

    def link_closed(self, problem: Problem) -> None:
        if problem.code == LOGIN_WANTED:
            self.login = problem

    def dial_failed(self, problem: Problem) -> None:
        self.failed = True
        self.settled.set()

    def message_received(self, topic: str, message: Any, note: str | None) -> None:
        pass

    def status_received(self, level: str, text: str) -> None:
        pass

    def junk_received(self, why: str) -> None:
        pass

    def large_skipped(self, topic: str | None, size: int) -> None:
        pass


class Questions:
    """Of one car, beside `main`, the link with its messages. `diagnosis` gets the meaning of the answers."""

    def __init__(self, main: LiveSource, diagnosis: Diagnosis, *, now: Callable[[], float]) -> None:
        self._main = main
        self._diagnosis = diagnosis
        self._now = now
        self._own: QuestionChannel | None = None
        self._listener = _Silent()
        self._overdue: dict[asyncio.Task[Any], tuple[float, bool]] = {}  # time of the call, whether it is a quick one
        self._asking = 0
        self._pause_s = FIRST_PAUSE_S
        self._dial_again_s = 0.0

    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        """The values a service answers. Raises LinkDown where the car's link is down, CallFailed in all other cases."""
        if not self._main.is_open:
            self._drop()
            raise LinkDown("not called: no connection to the car")
        link = await self._link()
        sent_s, is_quick = self._now(), service in SIGNS_OF_LIFE and not self._asking
        task = asyncio.ensure_future(link.call(service, arguments, timeout_s=LONGEST_S))
        self._asking += 1
        task.add_done_callback(self._answered)
        await asyncio.sleep(0)  # it is written now
        if link is not self._main:
            with contextlib.suppress(LinkDown):
                link.ping()  # its answer comes before that of the question, unless rosapi is what takes long
        try:
            done, _ = await asyncio.wait({task}, timeout=timeout_s)
        except asyncio.CancelledError:
            task.cancel()
            raise
        if not done:
            self._overdue[task] = sent_s, is_quick
            self._suspect(link)
            raise CallFailed(f"{service} did not answer within {timeout_s:g} s")
        try:
            values = task.result()
        except Refusal as refusal:
            if service in SIGNS_OF_LIFE:
                self._diagnosis.failed(str(refusal))
            raise
        except LinkDown as down:
            if not self._main.is_open:
                raise
            raise CallFailed(f"{service} was not answered: {down}") from None
        self._pause_s = FIRST_PAUSE_S
        if service in SIGNS_OF_LIFE:
            self._diagnosis.answered(self._now())
        return values

    @property
    def login(self) -> Problem | None:
        """The bridge wants a login."""
        return self._listener.login

    def stop(self) -> None:
        """No question more."""
        self._drop()

    async def _link(self) -> QuestionChannel:
        """The connection to ask on. Raises CallFailed while it is held up."""
        now_s = self._now()
        if self._overdue:
            self._suspect(self._own or self._main)
            if any(now_s - at_s > (GIVE_UP_S if quick else GIVE_UP_LONG_S) for at_s, quick in self._overdue.values()):
                self._drop()
                self._dial_again_s = now_s + self._pause_s
                self._pause_s = min(self._pause_s * 2, LAST_PAUSE_S)
            raise CallFailed("not called: an earlier call is unanswered")
        if now_s < self._dial_again_s:
            raise CallFailed("not called: earlier calls were not answered")
        if self._own is None:
            self._listener = _Silent()
            self._own = self._main.beside(self._listener)
            self._own.start()
        own = self._own
        if not own.is_open:
            self._listener.settled.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(OPENS_WITHIN_S):
                    await self._listener.settled.wait()
        if own.is_open:
            return own
        if self._listener.failed and self._main.is_open:
            return self._main  # the bridge takes no second connection
        raise CallFailed("not called: no connection for calls yet")

    def _answered(self, task: asyncio.Task[Any]) -> None:
        self._asking -= 1
        error = None if task.cancelled() else task.exception()
        if self._overdue.pop(task, None) is not None and not task.cancelled():
            if error is None:  # late, by a slow link: rosapi lives
                self._diagnosis.answered(self._now())
            elif isinstance(error, Refusal):
                self._diagnosis.failed(str(error))

    def _suspect(self, link: QuestionChannel) -> None:
        """What is not answered is held against rosapi only where the bridge has read the question: it has answered
        the ping behind it."""
        if link is self._main or link.unanswered == 0:
            for sent_s, is_quick in self._overdue.values():
                if is_quick:
                    self._diagnosis.unanswered(sent_s)

    def _drop(self) -> None:
        own, self._own = self._own, None
        overdue, self._overdue = self._overdue, {}
        for task in overdue:
            task.cancel()
        if own is not None:
            own.stop()
