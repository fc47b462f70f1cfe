"""The doctor of pymcap-cli before a recording of ours."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

# What it remarks, and why it is so on purpose.
REMARKS = {
    "METADATA_NAME_DUPLICATE": "what is known of a drive is written at its beginning and again later, so that a kill "
    "does not lose it; the specification allows several records of one name",
    "NO_ATTACHMENTS": "a drive without voice notes and photos has none",
}


def examined(path: Path) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Its findings, and its summary with `exit_code`."""
    doctor = Path(sys.executable).with_name("pymcap-cli")
    found = subprocess.run(
        [doctor, "doctor", "--quiet", "--format", "jsonl", path], capture_output=True, text=True, check=False
    )
    rows = [json.loads(line) for line in found.stdout.splitlines()]
    assert rows, found.stderr
    return [row for row in rows if row["type"] == "finding"], {"exit_code": found.returncode} | rows[-1]
