"""What is known of an order to slow the car; the shell fills it, the checks read it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowingFacts:
    """The order at one moment; times on the clock of `received_s`."""

    is_armed: bool = False
    topic: str = ""  # where commands go
    rivals: tuple[str, ...] = ()  # who else publishes there, by the names of their nodes
    ordered_s: float | None = None  # time of the active order; None: none is active
    sending_s: float | None = None  # since when its commands go out without a gap; None: they do not
    deceleration_mps2: float = 0.0
    commanded_mps: float | None = None  # the newest command
    ended_at_longest_s: float | None = None  # when an order ended because it stood as long as is allowed
