"""Imports at the start what libraries import when they first need it: where no file can be opened any more, they fail.

`np.median` does so in the proof of a slow-down, anyio with the first file that is sent, `strptime` and the codecs with
their first use.
"""

from __future__ import annotations

import codecs
import time

import anyio._backends._asyncio  # noqa: F401
import numpy.ma  # noqa: F401

for _codec in ("idna", "unicode_escape", "latin-1", "utf-8-sig", "punycode"):
    codecs.lookup(_codec)
time.strptime("0", "%S")
