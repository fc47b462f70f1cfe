"""What situations that pass in virtual time need."""

from __future__ import annotations

from tests.event_loops import pytest_asyncio_loop_factories as pytest_asyncio_loop_factories
from tests.event_loops import virtual_clock as virtual_clock
