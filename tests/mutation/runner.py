"""Runs mutants in forks of one pytest session: what is imported and collected once serves them all.

A first pass runs each test alone and notes which lines it executes. A mutant then runs the tests of its lines only, the
quickest first, until one fails. Tests that take long are left out.
"""

from __future__ import annotations

import gc
import hashlib
import json
import os
import resource
import signal
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterable
from functools import cache, partial
from pathlib import Path
from types import CodeType, FunctionType

import coverage
import pytest

from tests.mutation.mutants import Mutant, MutatedFile
from tests.tree import PROJECT

TESTS = (
    "tests/monitor",
    "tests/server/control/test_alarm_reach.py",
    "tests/server/control/test_authorization.py",
    "tests/server/control/test_display_name.py",
    "tests/server/control/test_lease.py",
    "tests/server/control/test_lease_acts.py",
    "tests/server/slowdown/test_countdown.py",
    "tests/server/slowdown/test_order.py",
    "tests/server/slowdown/test_order_edges.py",
    "tests/server/slowdown/test_response.py",
    "tests/world/test_slow_link.py",
)
SOURCES = ("monitor", "server/control", "server/slowdown")
OUT = PROJECT / "out" / "mutation"
WALL_S = 600  # for one mutant, where it waits for something that never comes
SURVIVED, KILLED, OUT_OF_TIME = 0, 1, 2
VERDICTS = {SURVIVED: "survived", KILLED: "killed", OUT_OF_TIME: "survived"}


class Runner:
    """A pytest plugin in the place of its test loop."""

    def __init__(
        self,
        recorder: coverage.Coverage,
        files: Iterable[MutatedFile],
        chosen: list[Mutant],
        budget_s: float,
        longest_s: float,
        done: Callable[[Mutant, str, float, str], None],
    ) -> None:
        self._recorder = recorder
        self._files = {file.path: file for file in files}
        self._chosen = chosen
        self._budget_s = budget_s
        self._longest_s = longest_s
        self._done = done

    def pytest_configure(self) -> None:
        """A failing example is enough: to make it small costs much and shows nothing here."""
        from hypothesis import Phase, settings

        phases = (Phase.explicit, Phase.generate)
        settings.register_profile("mutation", phases=phases, database=None, derandomize=True, deadline=None)
        settings.load_profile("mutation")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        if session.testsfailed:
            raise session.Interrupted("tests cannot be collected")
        items = {item.nodeid: item for item in session.items}
        cover, cost_s = self._cover(session)
        functions, caches = _functions(), _caches()
        for mutant in self._chosen:
            names = self._tests(mutant, cover, functions)
            ordered = [items[name] for name in sorted(names, key=lambda name: (cost_s[name], name))]
            if not ordered:
                self._done(mutant, "declares" if self._is_import_only(mutant) else "not run", 0.0, "")
                continue
            started_s = time.monotonic()
            allowed_s = self._budget_s + 10 + 10 * max(cost_s[item.nodeid] for item in ordered)
            verdict, by = _in_fork(partial(self._try, mutant, ordered, functions, caches), allowed_s)
            self._done(mutant, verdict, time.monotonic() - started_s, by)
        return True

    def _cover(self, session: pytest.Session) -> tuple[dict[str, dict[int, set[str]]], dict[str, float]]:
        """Tests by file and line, and the processor time of each; from the last run where nothing has changed."""
        kept = OUT / f"cover-{_fingerprint([item.nodeid for item in session.items], self._longest_s)}.json"
        if kept.is_file():
            cost_s, lines = json.loads(kept.read_text())
        else:
            cost_s = {}
            for item, following in zip(session.items, [*session.items[1:], None], strict=True):
                self._recorder.switch_context(item.nodeid)
                before_s, failed_before = time.process_time(), session.testsfailed
                item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
                took_s = time.process_time() - before_s
                if session.testsfailed > failed_before or took_s > self._longest_s:
                    why = "it fails without any mutant" if session.testsfailed > failed_before else "too slow"
                    print(f"\nleft out, {why}: {item.nodeid}")
                    session.testsfailed = failed_before
                else:
                    cost_s[item.nodeid] = took_s
            data = self._recorder.get_data()
            lines = {path: data.contexts_by_lineno(str(PROJECT / path)) for path in self._files}
            kept.write_text(json.dumps((cost_s, lines)))
        self._recorder.stop()
        self._at_import = {path: {int(line) for line, tests in of.items() if "" in tests} for path, of in lines.items()}
        cover = {path: {int(line): cost_s.keys() & tests for line, tests in of.items()} for path, of in lines.items()}
        print(f"\n{len(cost_s)} of {len(session.items)} tests serve")
        return cover, cost_s

    def _is_import_only(self, mutant: Mutant) -> bool:
        """Whether only the import executes it, and no test: a declaration, or a constant that declarations read."""
        return mutant.is_constant or not self._at_import[mutant.path].isdisjoint(
            range(mutant.line, mutant.end_line + 1)
        )

    def _tests(
        self, mutant: Mutant, cover: dict[str, dict[int, set[str]]], functions: dict[str, list[FunctionType]]
    ) -> set[str]:
        """Those which execute the line; of a constant those which execute a function that reads it."""
        if mutant.is_constant:
            readers = [one.__code__ for group in functions.values() for one in group if _reads(one.__code__, mutant)]
        elif mutant.in_signature:
            readers = _code_objects((PROJECT / mutant.path).read_text(), mutant.path)[mutant.function]
        else:
            span = range(mutant.line, mutant.end_line + 1)
            return set().union(*(cover[mutant.path].get(line, set()) for line in span))
        found: set[str] = set()
        for code in readers:
            lines = cover.get(code.co_filename.removeprefix(f"{PROJECT}/"), {})
            found |= set().union(*(lines.get(line, set()) for _, _, line in code.co_lines() if line))
        return found

    def _try(
        self, mutant: Mutant, items: list[pytest.Item], functions: dict[str, list[FunctionType]], caches: list[object]
    ) -> tuple[int, str]:
        install(self._files[mutant.path], mutant, functions)
        for cached in caches:
            cached.cache_clear()  # type: ignore[attr-defined]
        session = items[0].session
        before = session.testsfailed
        for item, following in zip(items, [*items[1:], None], strict=True):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if session.testsfailed > before:
                return KILLED, item.nodeid
            if time.process_time() > self._budget_s:
                return OUT_OF_TIME, f"after {self._budget_s:.0f} s"
        return SURVIVED, ""


def _in_fork(judge: Callable[[], tuple[int, str]], allowed_s: float) -> tuple[str, str]:
    """The verdict of a child process: an exception there or too much time kills a mutant too."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        code, by = KILLED, "the mutant cannot be run"
        try:
            silence = os.open(os.devnull, os.O_WRONLY)
            os.dup2(silence, 1)
            os.dup2(silence, 2)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(WALL_S)
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            resource.setrlimit(resource.RLIMIT_CPU, (int(allowed_s) + 1, int(allowed_s) + 2))
            code, by = judge()
        finally:
            os.write(writer, by.encode()[:4000])
            os._exit(code)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        by = pipe.read().decode()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return "killed", f"signal {os.WTERMSIG(status)}"
    return VERDICTS[os.WEXITSTATUS(status)], by


def install(file: MutatedFile, mutant: Mutant, functions: dict[str, list[FunctionType]]) -> None:
    """Put the mutant's code in the place of the function's own, wherever the function is already known."""
    source = file.source(mutant)
    if mutant.is_constant:
        _replace_constant(mutant, source)
        return
    old, new = _code_objects((PROJECT / file.path).read_text(), file.path), _code_objects(source, file.path)
    for function in functions[file.path]:
        name = function.__code__.co_qualname
        if name != mutant.function and not name.startswith(f"{mutant.function}.<locals>."):
            continue
        place = [code.co_firstlineno for code in old[name]].index(function.__code__.co_firstlineno)
        if mutant.in_signature:
            _take_defaults(function, source, place)
        function.__code__ = new[name][place]


def _reads(code: CodeType, mutant: Mutant) -> bool:
    nested = [const for const in code.co_consts if isinstance(const, CodeType)]
    return mutant.function in code.co_names or any(_reads(one, mutant) for one in nested)


def _replace_constant(mutant: Mutant, source: str) -> None:
    """The new value wherever the old one was imported."""
    name = mutant.path.removesuffix(".py").replace("/", ".")
    scope: dict[str, object] = {"__name__": name}
    exec(compile(source, "<mutant>", "exec", dont_inherit=True), scope)
    old = vars(sys.modules[name])[mutant.function]
    for module in list(sys.modules.values()):
        if getattr(module, "__dict__", {}).get(mutant.function) is old:
            setattr(module, mutant.function, scope[mutant.function])


def _take_defaults(function: FunctionType, source: str, place: int) -> None:
    """Default values stand beside the code: those of the mutated module, as they are when it is executed."""
    scope: dict[str, object] = {"__name__": function.__module__}
    seen: list[FunctionType] = []
    exec(compile(source, "<mutant>", "exec", dont_inherit=True), scope)
    for one in gc.get_objects():
        if isinstance(one, FunctionType) and one.__globals__ is scope and one.__qualname__ == function.__qualname__:
            seen.append(one)
    found = sorted(seen, key=lambda one: one.__code__.co_firstlineno)[place]
    function.__defaults__, function.__kwdefaults__ = found.__defaults__, found.__kwdefaults__


@cache
def _code_objects(source: str, path: str) -> dict[str, list[CodeType]]:
    """Code by qualified name, in the order of the file."""
    found: dict[str, list[CodeType]] = defaultdict(list)
    waiting = [compile(source, str(PROJECT / path), "exec", dont_inherit=True)]
    while waiting:
        code = waiting.pop(0)
        found[code.co_qualname].append(code)
        waiting.extend(const for const in code.co_consts if isinstance(const, CodeType))
    return {name: sorted(codes, key=lambda code: code.co_firstlineno) for name, codes in found.items()}


def _functions() -> dict[str, list[FunctionType]]:
    """Every function of the mutated packages, by its file."""
    found: dict[str, list[FunctionType]] = defaultdict(list)
    for one in gc.get_objects():
        if isinstance(one, FunctionType):
            path = one.__code__.co_filename.removeprefix(f"{PROJECT}/")
            if path.startswith(SOURCES):
                found[path].append(one)
    return found


def _caches() -> list[object]:
    """What remembers results of functions that are mutated."""
    modules = [module for name, module in sys.modules.items() if name.startswith(("monitor", "server."))]
    return [value for module in modules for value in vars(module).values() if hasattr(value, "cache_clear")]


def _fingerprint(names: list[str], longest_s: float) -> str:
    """Of the tests and everything they run here."""
    digest = hashlib.sha256("\n".join([str(longest_s), *names]).encode())
    for folder in (*SOURCES, "tests/monitor", "tests/server/control", "tests/server/slowdown"):
        for path in sorted(Path(PROJECT / folder).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
