"""The pages' markup, where browsers do not mind and the checkers of HTML do."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path

import pytest

from server.app.config import Config
from tests.http import http_client
from tests.server.conftest import serving

PHRASES = {"b", "button", "h1", "h2", "h3", "p", "span"}  # what they hold is text and its marks, no blocks
BLOCKS = {"div", "h1", "h2", "h3", "nav", "p", "section", "ul", "ol", "table"}


class Markup(HTMLParser):
    """Blocks inside phrases, and `hidden` on drawings, which is an attribute of HTML's elements alone."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.wrong: list[str] = []
        self.seen = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen += 1
        if tag == "svg" and "hidden" in dict(attrs):
            self.wrong.append(f"<svg hidden>, line {self.getpos()[0]}")
        if tag in BLOCKS and (PHRASES - {"p"}) & set(self.open):
            self.wrong.append(f"<{tag}> in {self.open[-1]}, line {self.getpos()[0]}")
        if tag in PHRASES:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag in self.open:
            del self.open[len(self.open) - 1 - self.open[::-1].index(tag) :]


@pytest.mark.parametrize("path", ["/", "/fleet", "/offline"])
async def test_phrases_hold_no_blocks_and_no_drawing_is_hidden(path: str, tmp_path: Path) -> None:
    async with serving(Config(data=tmp_path)) as base, http_client(base_url=base) as client:
        markup = Markup()
        markup.feed((await client.get(path)).text)
    assert markup.seen > 5
    assert markup.wrong == []
