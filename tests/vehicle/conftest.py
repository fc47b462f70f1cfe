"""The guard lies outside the package: it is copied to a car as it is."""

from __future__ import annotations

import sys

from tests.tree import PROJECT

GUARD = PROJECT / "vehicle" / "ocu_guard"
sys.path.insert(0, str(GUARD))

from ocu_guard.guard import Command, Guard  # noqa: E402 - from where it was just put

__all__ = ["GUARD", "Command", "Guard"]
