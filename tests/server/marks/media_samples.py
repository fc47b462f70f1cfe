"""First bytes that make a file what it is."""

from __future__ import annotations

VOICE = b"\x1a\x45\xdf\xa3" + b"voice" * 100
OGG = b"OggS" + b"voice" * 100
PHOTO = b"\xff\xd8\xff\xe0" + b"photo" * 1000
PNG = b"\x89PNG\r\n\x1a\n" + b"photo" * 1000
