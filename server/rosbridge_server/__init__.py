"""A rosbridge server of our own, so that recordings and the simulated car look like a real vehicle on the wire."""

from __future__ import annotations
