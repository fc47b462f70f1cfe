"""Appends to a log as fast as it can, in a process of its own, and prints the number of each event that was kept."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

from server.bus.journal import Journal


def main() -> None:
    """Arguments: the file; the most bytes that a file may grow to (0: any)."""
    path, most = Path(sys.argv[1]), int(sys.argv[2])
    if most:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))  # as a full disk does it: the kernel takes no more
    journal = Journal(path)
    number = journal.last("car")
    while True:
        batch = [
            {"at_ms": number, "alarm": f"alarm {number % 7}", "change": "raised", "text": "x" * (number * 37 % 400)}
            for number in range(number + 1, number + 2 + number % 3)
        ]
        number = journal.append("car", batch)[-1]["n"]
        print(number, journal.trouble or "", flush=True)
        if journal.trouble and number > 4_000:
            return


if __name__ == "__main__":
    main()
