"""Who gives the command that is being carried out: what is logged meanwhile under this name bears their person."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from server.control.duty import OnDuty

# The name by which it is logged, and who is on duty there; None: nobody is.
acting: ContextVar[tuple[str, OnDuty] | None] = ContextVar("acting", default=None)


@contextmanager
def acting_as(name: str, person: OnDuty | None) -> Iterator[None]:
    """What is logged under `name` in this block bears this person."""
    before = acting.set(None if person is None else (name, person))
    try:
        yield
    finally:
        acting.reset(before)
