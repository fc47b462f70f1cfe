"""What can be wrong with a recording."""

from __future__ import annotations


class RecordingUnreadable(Exception):
    """The recording cannot be read. The text is one clear sentence for a person, and names the file."""


class Undecodable(Exception):
    """One message, or all messages of one type, cannot be understood. The text says why."""
