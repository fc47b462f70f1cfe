"""What somebody calls himself, in one clean line."""

from __future__ import annotations

import pytest

from server.control.display_name import MAX_LETTERS, clean, of_program


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("Ann", "Ann"),
        ("  Ann \n B ", "Ann B"),
        ("A\u202enn", "A nn"),
        ("x" * (MAX_LETTERS + 1), "x" * MAX_LETTERS),
        ("x" * (MAX_LETTERS - 1) + " y", "x" * (MAX_LETTERS - 1)),
        (" " * 8 * MAX_LETTERS + "late", None),
        (" " * (8 * MAX_LETTERS - 1) + "late", "l"),
        ("\u200b\t", None),
        ("", None),
        (7, None),
        (None, None),
    ],
)
def test_a_name_in_one_line(text: object, name: str | None) -> None:
    assert clean(text) == name


@pytest.mark.parametrize(
    ("user_agent", "name"),
    [
        ("curl/8.0", "api · curl"),
        ("curl/8.0/9", "api · curl"),
        ("my tool 2/1.0", "api · my"),
        ("python-requests", "api · python-requests"),
        ("/8.0", "api"),
        ("", "api"),
        (None, "api"),
    ],
)
def test_a_program_is_called_after_its_product(user_agent: str | None, name: str) -> None:
    assert of_program(user_agent) == name
