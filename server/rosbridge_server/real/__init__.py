"""The bridge as a real rosbridge_suite server behaves, with its silences and its faults: `--like real`."""

from __future__ import annotations
