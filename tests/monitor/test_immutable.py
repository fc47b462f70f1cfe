"""What is made for every message is immutable to the type checker."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.tree import PROJECT

WRITES = """
from monitor.check import Quantity
from monitor.shell_facts import LinkFacts
from monitor.reading import Reading
from monitor.snapshot import Snapshot

def write(snapshot: Snapshot, reading: Reading[float], link: LinkFacts, quantity: Quantity) -> None:
    snapshot.now_s = 2.0
    reading.value = 3.0
    link.attempts = 4
    quantity.value = 5.0
    Snapshot(1.0)
"""


@pytest.mark.slow
def test_no_field_can_be_written_and_none_is_given_by_its_place(tmp_path: Path) -> None:
    options = ("--config-file=", "--follow-imports=silent", f"--cache-dir={tmp_path}")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *options, "-c", WRITES], cwd=PROJECT, capture_output=True, text=True, check=False
    )
    errors = [line for line in done.stdout.splitlines() if "error:" in line]
    assert [line for line in errors if "is read-only" in line] == errors[:4], done.stdout
    assert [line.split(":")[1] for line in errors[:4]] == ["8", "9", "10", "11"]
    assert "positional" in errors[4], done.stdout
