"""Finds every check and composes every threshold."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from monitor.check import Check, Limits

AnyCheck = Check[Any]


class AllLimits(Limits):
    """To follow: one field per limits group, `AllLimits().speed_limit.max_mps`."""


def load() -> tuple[AnyCheck, ...]:
    """Every check of monitor/checks, in the order of their files."""
    return ()


def flat(limits: AllLimits) -> dict[str, float]:
    """Every threshold by its full name: {"speed_limit.max_mps": 11.0, …}."""
    return {}


def defaults() -> AllLimits:
    return AllLimits()


def changed(limits: AllLimits, values: dict[str, float]) -> AllLimits:
    """`limits` with some thresholds by full name replaced; raises pydantic.ValidationError naming the field."""
    return limits


def expected_rates(limits: AllLimits) -> dict[str, float]:
    """The rates the operator has set [Hz], for `State.expect`."""
    return {}


__all__ = ["AllLimits", "AnyCheck", "Sequence", "changed", "defaults", "expected_rates", "flat", "load"]
