"""Imports at the start what libraries import when they first need it: where no file can be opened any more, they fail.

And the event loop would wait for the disk. `np.median` does so in the proof of a slow-down, anyio and the types of
files with the first file that is sent, pydantic with the first schema, `strptime` and the codecs with their first use.
"""

from __future__ import annotations

import codecs
import mimetypes
import time

import anyio
import anyio._backends._asyncio
import numpy.ma  # noqa: F401

from monitor import catalog

for _codec in ("idna", "unicode_escape", "latin-1", "utf-8-sig", "punycode"):
    codecs.lookup(_codec)
_ = anyio.open_file  # its module is imported by asking for it
catalog.schema()  # kept, and made with the first change of a setting
mimetypes.init()
time.strptime("0", "%S")
