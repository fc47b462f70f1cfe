"""Problem documents, which read the same with every version of Python."""

from __future__ import annotations

import json

import pytest

from server.web.middleware.errors import problem


@pytest.mark.parametrize(
    ("status", "title"),
    [
        (404, "Not Found"),
        (413, "Content Too Large"),
        (414, "URI Too Long"),
        (416, "Range Not Satisfiable"),
        (422, "Unprocessable Content"),
    ],
)
def test_the_title_is_the_phrase_of_rfc_9110(status: int, title: str) -> None:
    assert json.loads(bytes(problem(status, "Why.").body))["title"] == title
