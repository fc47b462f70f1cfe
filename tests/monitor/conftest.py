"""Property tests on machines that are busy with other things: no deadline for one example."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("patient", deadline=None)
settings.load_profile("patient")
