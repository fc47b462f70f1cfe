"""Drives on disk: reading what was recorded, here or by others."""

from __future__ import annotations
