"""kill -9 at random moments: every message older than half a second is readable each time, and listed."""

from __future__ import annotations

import multiprocessing
import random
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest
from mcap.reader import make_reader

from server.recording.folder import RecordingsFolder
from server.recording.mcap.scan import by_name
from server.recording.own import METADATA
from tests.server.recording.made import recover_all
from tests.server.recording.recording_child import BEGAN_NS, MISSING, record_until_killed

pytestmark = pytest.mark.field

AT_ONCE = 2  # more of them would wait for each other on two cores
OLD_S = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Killed:
    """What one kill left."""

    missing: int  # of the messages older than half a second
    lost_s: float  # how old the oldest message was that could not be read
    files: int
    metadata: dict[str, str]  # of the last file


def kill_once(root: Path, after_s: float, part_s: float = 3600.0) -> Killed:
    """Lets a process record for so long, kills it, and recovers what it left."""
    context = multiprocessing.get_context("forkserver")
    ours, its = context.Pipe(duplex=False)
    process = context.Process(target=record_until_killed, args=(root, its, part_s), daemon=True)
    process.start()
    its.close()
    reports: list[tuple[int, int]] = [ours.recv()]  # it begins to record
    time.sleep(after_s)
    killed_ns = time.monotonic_ns()
    process.kill()
    process.join()
    try:
        while True:
            reports.append(ours.recv())
    except EOFError:
        pass
    folder = RecordingsFolder(root)
    left = folder.unfinished()
    done = recover_all(folder)
    assert len(done) == len(left)
    assert all(one.is_settled for one in done)
    assert [one.aside for one in done if one.aside] == []
    assert folder.unfinished() == []
    found: list[int] = []
    metadata: dict[str, str] = {}
    for path in folder.finished():
        with path.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            rows = [m.log_time for _, _, m in reader.iter_messages()]
            metadata = dict(by_name(list(reader.iter_metadata()), METADATA))
        found += [at_ns - BEGAN_NS for at_ns in rows]
    assert found == list(range(len(found))), "each once, in order, none missing in between"
    old = max((handed for at_ns, handed in reports if at_ns <= killed_ns - OLD_S * 1e9), default=0)
    lost_ns = min((at_ns for at_ns, handed in reports if handed > len(found)), default=killed_ns)
    return Killed(
        missing=max(0, old - len(found)),
        lost_s=(killed_ns - lost_ns) / 1e9,
        files=len(folder.finished()),
        metadata=metadata,
    )


def kill_often(root: Path, kills: int, part_s: float) -> list[Killed]:
    chance = random.Random(kills)
    multiprocessing.get_context("forkserver").set_forkserver_preload(["tests.server.recording.recording_child"])
    moments = [chance.uniform(0.0, 2.2) for _ in range(kills)]
    with ThreadPoolExecutor(AT_ONCE) as pool:
        return list(pool.map(lambda n: kill_once(root / str(n), moments[n], part_s), range(kills)))


@pytest.mark.parametrize(
    "kills", [pytest.param(10, marks=pytest.mark.slow), pytest.param(1000, marks=[pytest.mark.soak])]
)
def test_every_message_older_than_half_a_second_is_readable(tmp_path: Path, kills: int) -> None:
    found = kill_often(tmp_path, kills, part_s=3600.0)
    lost_s = sorted(one.lost_s for one in found)
    print(f"{kills} kills: at most {lost_s[-1]:.3f} s lost, median {lost_s[kills // 2]:.3f} s")
    assert [one.missing for one in found] == [0] * kills


@pytest.mark.parametrize(
    "kills", [pytest.param(6, marks=pytest.mark.slow), pytest.param(200, marks=[pytest.mark.soak])]
)
def test_killed_while_one_part_ends_and_the_next_begins_nothing_is_damaged(tmp_path: Path, kills: int) -> None:
    """The disk is waited for between two parts, so here more than half a second may be missing; nothing else is."""
    found = kill_often(tmp_path, kills, part_s=0.3)
    assert any(one.files > 1 for one in found), "some were killed in a later part"


@pytest.mark.world(n=4)
@pytest.mark.slow
def test_what_is_missing_in_a_recording_is_kept_in_one_that_was_recovered(tmp_path: Path) -> None:
    multiprocessing.get_context("forkserver").set_forkserver_preload(["tests.server.recording.recording_child"])
    found = kill_once(tmp_path, 1.0)
    assert found.metadata["ended"] == "recovered"
    assert {name: found.metadata.get(name) for name in MISSING} == MISSING
