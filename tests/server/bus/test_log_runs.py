"""A page across restarts, power cuts, restored and copied logs: it misses no event, repeats none, sees no number twice.

The page is the real module, in a process of its own; the log's runs are the real ones, its events a list.
"""

from __future__ import annotations

import copy
import itertools
import json
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from server.bus.journal import Journal
from server.bus.log_runs import SENT_ANEW, LogRuns, Resumed, Run
from tests.tree import PROJECT

PAGE = PROJECT / "tests" / "page" / "event_log_page.mjs"


class Page:
    """One page after the other, in one process."""

    def __init__(self) -> None:
        node = shutil.which("node")
        assert node is not None
        self._process = subprocess.Popen([node, str(PAGE)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, **request: Any) -> dict[str, Any]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{json.dumps(request)}\n")
        self._process.stdin.flush()
        answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        return answer

    def close(self) -> None:
        self._process.communicate()


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    one = Page()
    yield one
    one.close()


@dataclass
class Log:
    """What a disk holds: events in order, and where each run began; and the run that writes it now."""

    run: str = ""
    texts: list[str] = field(default_factory=list)
    runs: list[Run] = field(default_factory=list)

    def cut_off(self, lost: int) -> Log:
        """As the disk has it after a cut of power: without its newest writes."""
        texts = self.texts[: max(0, len(self.texts) - lost)]
        return Log(texts=texts, runs=[run for run in self.runs if run.before["car"] <= len(texts)])

    def begin(self, run: str) -> Log:
        """A server starts with it."""
        before = {"car": len(self.texts)}
        return Log(run=run, texts=list(self.texts), runs=[*self.runs, Run(id=run, before=before)])

    def events(self, after: int) -> list[dict[str, Any]]:
        found = [{"n": n, "text": text, "at_ms": int(text), "change": "mark"} for n, text in enumerate(self.texts, 1)]
        return found[after:]


class World:
    """One server at a time, and a page that comes and goes. An event's text is the moment when it happened."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.page.ask()
        self.log = Log().begin("run 0")
        self.kept: list[Log] = []  # copies of the disk
        self.names = itertools.count(1)
        self.moments = itertools.count(1)
        self.born = self.left = 0  # moments: the page's first greeting, and when it was last connected
        self.is_connected = False
        self.announced: list[str] = []
        self.named: dict[tuple[str, int], str] = {}  # which event a number of a run was

    def step(self, kind: str, amount: int) -> None:
        match kind:
            case "happens":
                self.log.texts += [str(next(self.moments)) for _ in range(amount)]
                if self.is_connected:
                    self.take(self.log.events(len(self.log.texts) - amount))
            case "connects":
                self.connect()
            case "leaves":
                self.leave()
            case "restarts" | "cut":
                self.start(self.log.cut_off(amount if kind == "cut" else 0))
            case "copied":
                self.kept.append(copy.deepcopy(self.log))
            case "restored" if self.kept:
                other = self.kept[amount % len(self.kept)]
                self.kept[amount % len(self.kept)] = self.log  # the card that is taken out may come back
                self.start(other)

    def start(self, log: Log) -> None:
        self.leave()
        self.log = log.begin(f"run {next(self.names)}")

    def leave(self) -> None:
        if self.is_connected:
            self.is_connected, self.left = False, next(self.moments)

    def connect(self) -> None:
        self.leave()
        runs, last = LogRuns(self.log.runs[:-1], self.log.runs[-1]), len(self.log.texts)
        hello = self.page.ask(hello={"boot": self.log.run, "last_event": last, "resumes": True})
        self.is_connected = True
        self.born = self.born or next(self.moments)
        if hello["boot"] == self.log.run:
            self.take(self.log.events(hello["have_event"]))
        else:
            found = runs.resume("car", hello["boot"], hello["have_event"], last)
            self.take(self.log.events(found.after), {"common": found.common, "new_after": found.new_after})
        self.check()

    def take(self, events: list[dict[str, Any]], resumed: dict[str, int] | None = None) -> None:
        for event in events:
            assert self.named.setdefault((self.log.run, event["n"]), event["text"]) == event["text"]
        answer = self.page.ask(events=events, **({"resumed": resumed} if resumed else {}))
        self.announced += answer["fresh"]
        self.rows = answer["rows"]

    def check(self) -> None:
        log = self.log.texts
        assert len(set(self.announced)) == len(self.announced), "none is announced again"
        assert self.rows == log[len(log) - len(self.rows) :], "the page has the log as it is, without a hole"
        since = [text for text in log if int(text) > self.born]
        assert set(since[-SENT_ANEW:]) <= set(self.rows)
        began = self.log.runs[-1].before["car"]
        new = {text for text in since if int(text) > self.left} | set(log[began:]) & set(since)
        assert new <= set(self.announced), "what happened while it was away is announced"


STEPS = st.tuples(
    st.sampled_from(["happens", "connects", "leaves", "restarts", "cut", "copied", "restored"]), st.integers(1, 6)
)


@settings(deadline=None, max_examples=300)
@given(story=st.lists(STEPS, min_size=4, max_size=40))
def test_a_page_misses_no_event_and_repeats_none_across_cuts_restores_and_copies(
    page: Page, story: list[tuple[str, int]]
) -> None:
    world = World(page)
    world.connect()
    for kind, amount in story:
        world.step(kind, amount)
    world.connect()


def at(n: int) -> Resumed:
    return Resumed(common=n, after=n, new_after=n)


def test_where_a_reader_of_each_run_goes_on() -> None:
    earlier = [Run(id="a"), Run(id="b", before={"car": 10}), Run(id="c", before={"car": 30, "truck": 2})]
    runs = LogRuns(earlier, Run(id="d", before={"car": 20, "truck": 2}))  # it lost its end after c had begun
    assert runs.resume("car", "a", 7, 25) == at(7)
    assert runs.resume("car", "a", 99, 25) == at(10)
    assert runs.resume("car", "b", 29, 25) == at(20), "no longer than it was later"
    assert runs.resume("truck", "b", 5, 25) == at(2)
    assert runs.resume("truck", "a", 5, 25) == at(0)
    assert runs.resume("car", "d", 24, 25) == at(24)
    assert runs.resume("car", "of another log", 24, 25) == Resumed(common=0, after=0, new_after=20)
    assert runs.resume("car", "of another log", 24, 3000) == Resumed(common=0, after=20, new_after=20)
    anew = LogRuns([], Run(id="e", before={"car": 2900}))
    assert anew.resume("car", "x", 24, 3000) == Resumed(common=0, after=3000 - SENT_ANEW, new_after=2900)


def test_a_log_keeps_where_its_runs_began_also_where_it_was_damaged(tmp_path: Path) -> None:
    path, event = tmp_path / "events.sqlite", {"at_ms": 1, "alarm": None, "change": "mark"}
    for run in ("a", "b"):
        journal = Journal(path, run=run)
        journal.append("car", [event] * 5)
        journal.close()
    shutil.copy(path, tmp_path / "copy.sqlite")
    journal = Journal(path, run="c")
    assert journal.runs.resume("car", "a", 9, 10) == at(5)
    assert journal.runs.resume("car", "b", 9, 10) == at(9)
    journal.append("car", [event])
    journal.close()
    copied = Journal(tmp_path / "copy.sqlite", run="d")
    assert copied.runs.resume("car", "c", 11, 10).common == 0, "what c wrote is not in the copy"
    assert copied.runs.resume("car", "b", 10, 10) == at(10)
    copied.close()
    body = bytearray(path.read_bytes())
    body[:16] = b"not a database!!"
    path.write_bytes(body)
    journal = Journal(path, run="e")
    assert journal.complaint is not None
    assert journal.runs.present == replace(Run(id="e"), before={name: journal.last(name) for name in journal._last})
    assert journal.runs.resume("car", "c", 11, 11).common <= journal.last("car")
    journal.close()
