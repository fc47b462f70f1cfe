"""The bridge as a real rosbridge_suite server behaves, with its silences and its losses: `--like real`.

What a client can send to end or silence a real server does nothing here.
"""

from __future__ import annotations
