"""The questions of a session to a Foxglove server, which its source answers from what the server has listed."""

from __future__ import annotations

from typing import Any, Protocol


class Asked(Protocol):
    @property
    def is_open(self) -> bool: ...
    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any: ...


class Answers:
    """A `QuestionChannel` that is open as long as the source is: nothing is sent for a question."""

    unanswered = 0

    def __init__(self, source: Asked) -> None:
        self._source = source

    @property
    def is_open(self) -> bool:
        return self._source.is_open

    def start(self) -> None:
        """There is nothing to dial."""

    def stop(self) -> None:
        """There is nothing to end."""

    def ping(self) -> None:
        """Nothing was sent that an answer could be behind."""

    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        return await self._source.call(service, arguments, timeout_s=timeout_s)
