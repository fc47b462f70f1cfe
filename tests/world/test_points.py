"""Every point of docs/world.md has tests, and every marked test its point."""

from __future__ import annotations

import re

import pytest

from tests.tree import PROJECT, project_files, text_of

BY_HAND = {3}  # real servers, tried by hand: their transcripts stand for them in the tests


@pytest.mark.world(n=1)
def test_every_point_has_tests_and_every_marked_test_its_point() -> None:
    page = (PROJECT / "docs" / "world.md").read_text(encoding="utf-8")
    points = {int(number) for number in re.findall(r"^\| (\d+) \|", page, re.MULTILINE)}
    tests = [path for path in project_files() if path.parts[0] == "tests" and path.suffix == ".py"]
    marked = {int(n) for path in tests for n in re.findall(r"mark\.world\(n=(\d+)\)", text_of(path) or "")}
    assert points == set(range(1, 28))
    assert marked == points - BY_HAND
