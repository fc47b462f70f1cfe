"""Holds a transfer to so many bytes a second, and ends it when it must end. Blocking: for a thread."""

from __future__ import annotations

from collections.abc import Callable

_STEP_S = 0.2  # after which it is asked again whether the transfer may go on


class Pace:
    """`may_go_on` is called before each portion and raises where the transfer must end."""

    def __init__(
        self,
        bytes_per_s: Callable[[], float],
        may_go_on: Callable[[], None],
        *,
        now: Callable[[], float],
        sleep: Callable[[float], object],
    ) -> None:
        self._bytes_per_s = bytes_per_s
        self._may_go_on = may_go_on
        self._now = now
        self._sleep = sleep
        self._due_s = 0.0

    def check(self) -> None:
        """Raises where the transfer must end."""
        self._may_go_on()

    def take(self, count: int) -> None:
        """Returns when so many more bytes may be sent or received."""
        self._may_go_on()
        rate = self._bytes_per_s()
        if rate <= 0:
            return
        self._due_s = max(self._due_s, self._now()) + count / rate
        while (left_s := self._due_s - self._now()) > 0:
            self._sleep(min(left_s, _STEP_S))
            self._may_go_on()
