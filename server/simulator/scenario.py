"""A scenario: a fault, or an action of a person, that can be started by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from server.simulator.driver import Order
from server.simulator.effects import Effect

BridgeFault = Literal["freeze", "kill"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A fault on demand.

    `effect` works on the messages of any source. `order` is what the simulated car's driver does meanwhile; where
    `order_suffices` the simulated car shows the fault by its own motion and the effect, if there is one, is left to
    recordings.
    """

    name: str
    sentence: str
    duration_s: float
    alarm: str  # as the table of alarms names it; "": it raises none
    consequences: tuple[str, ...] = ()  # what else may be raised, rightly
    effect: Callable[[], Effect] | None = None
    order: Order | None = None
    order_suffices: bool = False
    bridge: BridgeFault | None = None
