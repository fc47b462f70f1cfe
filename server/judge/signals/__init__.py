"""Finds the topics of every signal: one file of this package for a signal, or for a few that belong together."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from monitor.signals import SIGNALS
from server.judge.topic import Topic


def load() -> tuple[Topic, ...]:
    """The topics of every signal, in the order of `monitor.signals`.

    Raises ValueError where a signal has no topics, has them twice, or is not declared.
    """
    rows = [row for module in iter_modules(__path__) for row in import_module(f"{__name__}.{module.name}").TOPICS]
    names = sorted(row.signal for row in rows)
    if names != sorted(SIGNALS):
        wrong = sorted({name for name in [*names, *SIGNALS] if names.count(name) != 1 or name not in SIGNALS})
        raise ValueError(
            f"each signal of monitor/signals.py needs one Topic in server/judge/signals: {', '.join(wrong)}"
        )
    order = list(SIGNALS)
    return tuple(sorted(rows, key=lambda row: order.index(row.signal)))


TOPICS = load()
