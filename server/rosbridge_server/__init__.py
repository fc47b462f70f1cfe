"""Our own rosbridge server, so that recordings and the simulated car behave like a real vehicle."""

from __future__ import annotations
