"""A command that reads a file takes no more memory than the machine has, and reports the limit."""

from __future__ import annotations

import resource

import pytest

from server.system import process_limits
from server.system.process_limits import bounded_memory

pytestmark = pytest.mark.world(n=24)


def test_what_is_too_large_is_a_memory_error_and_the_bound_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    before = resource.getrlimit(resource.RLIMIT_DATA)
    read = process_limits._bytes
    small = {"MemAvailable": 100 << 20}
    monkeypatch.setattr(process_limits, "_bytes", lambda file, name: small.get(name) or read(file, name))
    with bounded_memory(), pytest.raises(MemoryError):
        bytearray(400 << 20)
    assert resource.getrlimit(resource.RLIMIT_DATA) == before
