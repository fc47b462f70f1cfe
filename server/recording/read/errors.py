"""What can be wrong with a recording."""

from __future__ import annotations


class RecordingUnreadable(Exception):
    """The recording cannot be read. The text is one clear sentence for a person, and names the file."""


class NoRoom(RecordingUnreadable):
    """There is no room on the disk for the copy that is needed to read it: the recording itself may be whole."""


class Undecodable(Exception):
    """One message, or all messages of a type, cannot be decoded. The text has the reason."""
