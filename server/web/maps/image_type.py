"""What kind of picture some bytes are: the three that every browser draws, told by their first bytes, not by a name."""

from __future__ import annotations

from html.parser import HTMLParser

SHOWN_ATTRIBUTION = 200


def media_type(data: bytes) -> str | None:
    """image/png, image/jpeg or image/webp; None for anything else, an SVG with a script in it included."""
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return "image/png"
    if data.startswith(b"\xff\xd8\xff"):
        return "image/jpeg"
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "image/webp"
    return None


def plain_text(markup: str) -> str:
    """The words of an attribution, which many files write as HTML: without tags, on one line, at most 200 letters."""
    reader = _Words()
    reader.feed(markup[:5000])
    reader.close()
    words = " ".join("".join(reader.pieces).split())
    return "".join(letter for letter in words if letter.isprintable())[:SHOWN_ATTRIBUTION]


class _Words(HTMLParser):
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
