"""The image type of some bytes, by their first bytes: the three types that every browser draws."""

from __future__ import annotations

import struct
from html.parser import HTMLParser

SHOWN_ATTRIBUTION = 200
TYPES = ("image/png", "image/jpeg", "image/webp")


def media_type(data: bytes) -> str | None:
    """image/png, image/jpeg or image/webp; None for anything else, an SVG with a script in it included."""
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return "image/png"
    if data.startswith(b"\xff\xd8\xff"):
        return "image/jpeg"
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "image/webp"
    return None


def pixels(data: bytes) -> tuple[int, int] | None:
    """Width and height from the image header, because few bytes can unpack to gigapixels. None: unknown."""
    try:
        match media_type(data):
            case "image/png":
                return struct.unpack_from(">II", data, 16) if data[12:16] == b"IHDR" else None
            case "image/jpeg":
                return _jpeg_pixels(data)
            case "image/webp":
                return _webp_pixels(data)
    except (struct.error, IndexError):
        pass
    return None


def _jpeg_pixels(data: bytes) -> tuple[int, int] | None:
    """Of the frame header (SOF); markers before it are passed over by their lengths."""
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF:
        kind = data[at + 1]
        if kind == 0xFF:  # padding
            at += 1
            continue
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        at += 2 + struct.unpack_from(">H", data, at + 2)[0]
    return None


def _webp_pixels(data: bytes) -> tuple[int, int] | None:
    match data[12:16]:
        case b"VP8X":
            return int.from_bytes(data[24:27], "little") + 1, int.from_bytes(data[27:30], "little") + 1
        case b"VP8L":
            (bits,) = struct.unpack_from("<I", data, 21)
            return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
        case b"VP8 ":
            width, height = struct.unpack_from("<HH", data, 26)
            return width & 0x3FFF, height & 0x3FFF
    return None


def plain_text(markup: str) -> str:
    """The text of an attribution, which many files write as HTML: without tags, on one line, at most 200 letters."""
    reader = _TextReader()
    reader.feed(markup[:5000])
    reader.close()
    text = " ".join("".join(reader.pieces).split())
    return "".join(letter for letter in text if letter.isprintable())[:SHOWN_ATTRIBUTION]


class _TextReader(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.pieces: list[str] = []
        self._hidden = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._hidden += tag in ("script", "style")

    def handle_endtag(self, tag: str) -> None:
        self._hidden -= tag in ("script", "style") and self._hidden > 0

    def handle_data(self, data: str) -> None:
        if not self._hidden:
            self.pieces.append(data)
