"""The texts that a person reads, on the page, in messages, help and guides, use the settled terms."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.tree import project_files, text_of

# Left: what was once written; right: what is written instead.
SETTLED = {
    r"\bSAFE\b": "slow-down: not armed",
    r"Connection lost: over": "Connection was lost, now back",
    r"are explained\b": "up to 23 m is normal",
    r"not allowed to tell": "Location permission denied on this phone",
    r"waiting for a fix": "No GPS fix on this phone",
    r"has not been heard for": "No position from this phone for",
    r"phones? tells? (?:where|its position)|tell where they are|tell their position": "share their position",
    r"nobody said which": "Using yours. Choose the phone in the car",
    r"Car ±\?": "accuracy unknown",
    r"tap a return": "tap a point for distance",
    r"Whoever orders something": "The first to act takes control",
    r"has it again by": "can reclaim it for 6 s",
    r"told on every page": "Taking over is announced to everyone",
    r"Do not ask any more": "Cancel request",
    r"Others command the car": "Another node is driving the car",
    r"any operator slows the car with": "When armed, one slide slows the car",
    r"as told then|judged anew": "original alarms, re-evaluated",
    r"It is read from the disk": "Opening…",
    r"Mail ordered": "E-mail queued",
    r"Faster than it happened": "Analysed at 68 × real time",
    r"They hold on this phone": "Saved on this phone only",
    r"on the network can read along": "anyone on the network can eavesdrop",
    r"can hear alarms\b(?!.*nobody)(?<=operators can hear alarms)": "Alarms audible on 1 of 1 operator page",
    r"\bIt began\b|it began at": "Began 18:37:12: obstacle 3.5 m ahead",
    r"\bAs recorded\b": "Last known",
    r"\} so far$": "15 alarms, still reading",
    r"\bBlind (?:for |\d|\$)": "No data for 30 s; no alarm began or ended",
    r"are too few to compare$": "No signal has a known rate",
    r"It is the position of": "Compared with",
    r"^static\S+ Asks$": "Will ask",
    r"As the phone|^(?:static|templates).*\b[Tt]his phone\b": "This device, System",
    r"Page before": "Previous page",
    r"that is shown beside this one": "Choose the recording to compare",
    r"\bvouch": "no public authority can certify the server",
    r"\bApart\b": "Distance apart",
    r"\bwith nobody\b": "unassigned",
    r"\b[Hh]and on\b": "hand over",
    r"\b(?:[Nn]ot|[Nn]ever|[Ll]ast|is|been|was) heard\b": "no data, no contact",
    r"\bheard (?:of|at)\b": "no data of, has not connected",
    r"^static\S+log-layout\S+ cleared$|(?i:\} cleared\b|\bor cleared\b|alarm (?:is |was )?cleared)": "ended",
    r"^static\S+slow-layout\S+ Off$": "Not armed",
    r"\b[Ww]hat stands\b|\bstands? in the report\b": "what is in force, what is shown",
    r"(?i)\balarms? (?:that )?stands?\b|\bno alarm stands\b|\bstill standing\b": "active",
}
JS_TEXT = re.compile(r"'((?:[^'\\\n]|\\.)*)'|`((?:[^`\\]|\\.)*)`")
SHOWN = re.compile(r">([^<>{}]+)<|(?:aria-label|title|placeholder)=\"([^\"{}]+)\"")


def python_texts(source: str) -> Iterator[str]:
    """What is no docstring: messages, help, the descriptions of the protocol."""
    tree = ast.parse(source)
    docs = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
            yield node.value


def texts(path: Path) -> Iterator[str]:
    source = text_of(path) or ""
    if path.suffix == ".py":
        yield from python_texts(source)
    elif path.suffix == ".js":
        code = re.sub(r"(?m)^\s*(?://|/?\*).*$|/\*\*.*?\*/|\s// .*$", "", source)
        yield from ("".join(found) for found in JS_TEXT.findall(code))
    elif path.suffix == ".html":
        yield from ("".join(found) for found in SHOWN.findall(source))
    else:
        yield from source.splitlines()


def is_read(path: Path) -> bool:
    """Whether a person reads what stands in it. Decisions and the changelog tell of what was."""
    if path.parts[0] == "docs" or path.name == "README.md":
        return path.suffix == ".md" and path.name != "decisions.md"
    return path.parts[0] in ("monitor", "server", "static", "templates") and path.suffix in (".py", ".js", ".html")


@cache
def all_texts() -> str:
    """A line for each text, with its file."""
    return "\n".join(
        f"{path}: {' '.join(text.split())}" for path in project_files() if is_read(path) for text in texts(path)
    )


@pytest.mark.parametrize("was", SETTLED)
def test_texts_use_the_settled_words(was: str) -> None:
    found = [line[:200] for line in all_texts().splitlines() if re.search(was, line)]
    assert found == [], f"write: {SETTLED[was]}"


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("a.py", '"""SAFE"""\nX = "SAFE"\n'),
        ("a.js", "// 'SAFE'\nconst x = 'SAFE';"),
        ("a.html", "<p class=SAFE>SAFE</p>"),
    ],
)
def test_a_text_is_found_and_a_comment_is_none(path: str, source: str, tmp_path: Path) -> None:
    (tmp_path / path).write_text(source, encoding="utf-8")
    assert [text for text in texts(tmp_path / path) if "SAFE" in text] == ["SAFE"]
