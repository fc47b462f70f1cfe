"""`catgraph check`: what it prints, writes and answers."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import orjson
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from server.analysis import summary
from server.simulator.scenarios import SCENARIOS
from tests.server.analysis.conftest import Checking, recorded
from tests.server.recording.bags import Drive, write_ros1
from tests.tree import PROJECT

# Faults for which the drive has no occasion: the car does not stand at 8 s, and no phone is in it.
NOT_HERE = {"gps-drift", "phone-mismatch", "mode-flaps"}


def test_a_healthy_drive_has_no_alarm(check: Checking, healthy: Path) -> None:
    ending = check(healthy)
    assert (ending.code, ending.err) == (0, "")
    assert "No alarms" in ending.out
    assert re.search(r"Evaluated in [\d.]+ s: \d+ × real time", ending.out)
    assert re.search(r"Speed +/catvehicle/vel +48\d +20\.\d Hz", ending.out)


def test_a_critical_alarm_is_exit_1(check: Checking, healthy: Path) -> None:
    ending = check(healthy, "--inject", "near-object@10", "--duration", "14", "--json", "-")
    assert ending.code == 1
    assert ending.raised() == ["obstacle_nearest"]
    (alarm,) = ending.json["alarms"]
    assert alarm["priority"] == "critical"
    assert alarm["raised_s"] == pytest.approx(10.0, abs=0.15)


def test_an_alarm_that_is_not_critical_is_exit_0(check: Checking, healthy: Path) -> None:
    ending = check(healthy, "--inject", "pedal-conflict@10", "--duration", "14", "--json", "-")
    assert (ending.code, ending.raised()) == (0, ["pedals"])


@pytest.mark.field
@pytest.mark.parametrize("name", [s.name for s in SCENARIOS.values() if s.effect is not None or s.bridge is not None])
def test_every_fault_of_messages_can_be_laid_over_a_recording(check: Checking, healthy: Path, name: str) -> None:
    """The report shows its effect, or states that this recording has nothing that it changes."""
    ending = check(healthy, "--inject", f"{name}@8", "--json", "-")
    assert ending.code in (0, 1), ending.err
    (laid,) = ending.json["injected"]
    if name in NOT_HERE:
        assert ending.raised() == []
        assert laid["touched"] or any("changed nothing" in note for note in ending.json["notes"])
        return
    assert laid["touched"] > 0
    assert ending.raised(), f"{name} raised nothing"
    assert [change["change"] for change in ending.json["compared"]["changes"]].count("appears") >= 1


def test_a_fault_of_motion_cannot_be_laid_over(check: Checking, healthy: Path) -> None:
    ending = check(healthy, "--inject", "standing@10")
    assert ending.code == 2
    assert ending.err == ("catgraph check: standing is a fault of the car's motion, which a recording cannot repeat.\n")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--inject", "no-such-fault@3"], "no-such-fault"),
        (["--inject", "near-object@99999"], "is behind the end"),
        (["--start", "99999"], "is behind the end: the recording has 24.0 s"),
        (["--duration", "0"], "leaves nothing to judge"),
        (["--start", "-1"], "is not a number of seconds, 0 or more"),
        (["--settings", "/nowhere.toml"], "/nowhere.toml cannot be read"),
        (["--json", "/nowhere/out.json"], "/nowhere/out.json cannot be written"),
        (["--html", "/nowhere/out.html"], "/nowhere/out.html cannot be written: /nowhere does not exist"),
        (["--html", "."], ". cannot be written: it is a directory"),
        (["--json", "/"], "/ cannot be written: it is a directory"),
        (["--html", "-"], "--html needs a file name"),
    ],
)
def test_what_cannot_be_done_is_exit_2_and_one_sentence(
    check: Checking, healthy: Path, arguments: list[str], sentence: str
) -> None:
    ending = check(healthy, *arguments)
    assert ending.code == 2
    assert ending.out == "", "it is refused before the work"
    assert sentence in ending.err
    assert "Traceback" not in ending.err


def test_what_is_no_recording(check: Checking, tmp_path: Path) -> None:
    (tmp_path / "a.bag").write_bytes(b"#ROSBAG V2.0\n")
    for path in (tmp_path / "a.bag", tmp_path / "gone.mcap"):
        ending = check(path)
        assert ending.code == 2
        assert ending.err.startswith("catgraph check: ")
        assert str(path) in ending.err
        assert ending.err.count("\n") == 1


def test_a_recording_that_breaks_off_is_judged_up_to_there(check: Checking, tmp_path: Path) -> None:
    rows = [
        (n / 20, "/catvehicle/vel", "geometry_msgs/msg/Twist", {"linear": {"x": 20.0 if n > 60 else 5.0}})
        for n in range(2000)
    ]
    bag = write_ros1(tmp_path / "cut.bag", Drive(messages=rows, compression="bz2", chunk_bytes=10_000))
    raw = bytearray(bag.read_bytes())
    chunks = [found.start() for found in re.finditer(b"BZh", raw)]
    middle = chunks[len(chunks) // 2]
    raw[middle : middle + 64] = bytes(64)  # the index stays in place
    bag.write_bytes(raw)
    ending = check(bag)
    assert ending.code == 2  # what the rest holds is not known
    assert "Aborted at" in ending.out
    assert "Speed above limit" in ending.out
    assert "cut.bag is damaged" in ending.err


def with_checksums(bag: Path, path: Path) -> Path:
    """The same bag with a checksum for each part, as recorders write it."""
    (source,) = bag.glob("*.mcap")
    with source.open("rb") as old, path.open("wb") as new:
        writer, channels = Writer(new, chunk_size=100_000, compression=CompressionType.NONE), {}
        writer.start(profile="ros2")
        for schema, channel, message in make_reader(old).iter_messages():
            assert schema is not None
            if channel.id not in channels:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, kind)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
    return path


def test_a_damaged_part_is_left_out_and_said(check: Checking, healthy: Path, tmp_path: Path) -> None:
    """What is whole is judged; whether the rest held an alarm is not known."""
    hurt = with_checksums(healthy, tmp_path / "hurt.mcap")
    with hurt.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    part = summary.chunk_indexes[len(summary.chunk_indexes) // 2]
    raw = bytearray(hurt.read_bytes())
    raw[part.chunk_start_offset + part.chunk_length // 2] ^= 0x40
    hurt.write_bytes(raw)
    ending = check(hurt, "--json", tmp_path / "out.json", "--html", tmp_path / "out.html")
    assert "Not all of it" in (tmp_path / "out.html").read_text()
    assert ending.code == 2
    assert ending.err.startswith("catgraph check: hurt.mcap is damaged: 1 part of ")
    assert ending.err.count("\n") == 1
    assert "Note: hurt.mcap is damaged" in ending.out
    assert "Alarm load" in ending.out
    found = orjson.loads((tmp_path / "out.json").read_bytes())["recording"]
    assert not found["complete"]
    assert len(found["damage"]) == 1


def test_settings_of_a_file_count(check: Checking, healthy: Path, tmp_path: Path) -> None:
    strict = tmp_path / "strict.toml"
    strict.write_text("[speed_limit]\nmax_mps = 3.0\n")
    ending = check(healthy, "--settings", strict, "--json", "-")
    assert (ending.code, ending.raised()) == (1, ["speed_limit"])
    assert ending.json["settings"]["changed"] == {"speed_limit.max_mps": 3.0}


def test_it_tells_when_the_car_would_have_been_slowed(check: Checking, healthy: Path, tmp_path: Path) -> None:
    """By a rule that is on, after its time and the count-down; by one that is off never."""
    rules = tmp_path / "rules.toml"
    rules.write_text("version = 1\n[limits.slow_down]\non_obstacle = 1\non_obstacle_after_s = 0.5\n")
    page, found, until = tmp_path / "page.html", tmp_path / "found.json", ("--duration", "16")
    near = ("--inject", "near-object@10+5", *until)
    output = check(healthy, *near, "--settings", rules, "--json", found, "--html", page).out
    (slowed,) = orjson.loads(found.read_bytes())["slow_downs"]
    assert slowed["trigger"] == "obstacle"
    assert slowed["countdown_s"] == pytest.approx(10.5, abs=0.3)
    assert slowed["at_s"] == pytest.approx(slowed["countdown_s"] + 2.0)
    assert re.search(r"Would have slowed the car.*\n +12\.\d s +Obstacle within the stopping distance", output)
    assert "Would have slowed the car" in page.read_text()
    short = check(healthy, "--inject", "near-object@10+1.5", *until, "--settings", rules, "--json", "-")
    assert short.json["slow_downs"] == []  # gone before the count-down ended
    assert check(healthy, *near, "--json", "-").json["slow_downs"] == []


def test_wrong_settings_are_all_named(check: Checking, healthy: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text("[speed_limit]\nmax_mph = 3.0\nmax_mps = 900.0\n[obstacles]\nx = 1\n")
    ending = check(healthy, "--settings", bad)
    assert ending.code == 2
    lines = ending.err.splitlines()
    assert len(lines) == 3
    assert any("speed_limit.max_mps is near" in line for line in lines)
    assert any("0.5" in line and "40" in line for line in lines)  # the range
    assert any("[obstacles]" in line and "obstacle is near" in line for line in lines)


def test_two_settings_are_compared(check: Checking, healthy: Path, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("[speed_limit]\nmax_mps = 3.0\n")
    (tmp_path / "b.toml").write_text("[speed_limit]\nmax_mps = 4.0\n[gps_fix]\nstrict = 1\n")
    found = tmp_path / "found.json"
    compared = check(
        healthy, "--compare", tmp_path / "a.toml", tmp_path / "b.toml", "--duration", "14", "--json", found
    )
    assert compared.code == 1
    changes = {
        (change["change"], change["alarm"]) for change in orjson.loads(found.read_bytes())["compared"]["changes"]
    }
    assert changes == {("moves", "speed_limit"), ("appears", "gps_quality")}
    assert "a.toml → b.toml" in compared.out
    assert "Speed limit: 3 → 4 m/s" in compared.out
    back = check(healthy, "--compare", tmp_path / "b.toml", tmp_path / "a.toml", "--duration", "14", "--json", "-")
    assert ("vanishes", "gps_quality") in {
        (change["change"], change["alarm"]) for change in back.json["compared"]["changes"]
    }


def test_the_same_settings_twice_change_nothing(check: Checking, healthy: Path, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("[speed_limit]\nmax_mps = 3.0\n")
    ending = check(healthy, "--compare", tmp_path / "a.toml", tmp_path / "a.toml", "--duration", "10")
    assert "No alarm appears, vanishes or moves" in ending.out


def test_compare_and_settings_exclude_each_other(check: Checking, healthy: Path, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("")
    ending = check(healthy, "--compare", tmp_path / "a.toml", tmp_path / "a.toml", "--settings", tmp_path / "a.toml")
    assert (ending.code, "omit --settings" in ending.err) == (2, True)


def test_a_part_is_judged(check: Checking, healthy: Path) -> None:
    ending = check(healthy, "--start", "10", "--duration", "5", "--json", "-")
    judged = ending.json["judged"]
    assert judged["from_s"] == pytest.approx(10.0, abs=0.1)
    assert judged["to_s"] == pytest.approx(15.0, abs=0.1)


def test_several_files_are_one_recording_where_that_is_said(check: Checking, tmp_path: Path) -> None:
    first = recorded(tmp_path / "first", 6.0)
    ending = check(first, first, "--one-recording", "--json", "-")
    once = check(first, "--json", "-")
    assert ending.json["recording"]["messages"] == 2 * once.json["recording"]["messages"]


def test_the_page_is_one_file_and_works_offline(check: Checking, healthy: Path, tmp_path: Path) -> None:
    page = tmp_path / "drive.html"
    ending = check(healthy, "--inject", "gps-jump@10", "--duration", "14", "--html", page)
    assert ending.code == 0
    assert f"Page: {page}" in ending.out
    text = page.read_text()
    assert not re.findall(r"""(?:src|href)=["'](?!data:|#)[^"']*["']""", text)
    assert "fetch(" not in text
    assert "import(" not in text
    assert [path.name for path in tmp_path.iterdir()] == ["drive.html"]  # nothing half-written beside it


def test_json_goes_to_a_file_whole(check: Checking, healthy: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.json"
    ending = check(healthy, "--json", out)
    assert "No alarms" in ending.out
    assert out.read_bytes().endswith(b"}\n")


@pytest.mark.parametrize("count", [1, 2])
def test_a_terminal_sees_how_far_it_is(count: int, healthy: Path) -> None:
    """On a long job, in one bar for all recordings; a pipe gets nothing of it."""
    command = [sys.executable, "-c", _SLOW, "check", *[str(healthy)] * count, "--duration", "8"]
    ours, theirs = pty.openpty()
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=theirs) as process:
        os.close(theirs)
        seen = b""
        while True:
            try:
                part = os.read(ours, 4096)
            except OSError:  # the other end is closed
                break
            if not part:
                break
            seen += part
    os.close(ours)
    assert process.returncode == 0
    text = seen.decode()
    percents = [int(number) for number in re.findall(r"(\d+) %", text)]
    assert len(percents) >= 3
    assert percents == sorted(percents)
    assert "█" in text
    assert text.endswith("\r\x1b[K")  # it wipes its line
    piped = subprocess.run(command, capture_output=True, check=True)
    assert piped.stderr == b""


SHELL_CASES = {
    "nothing to read from": ("<&-", 0),
    "nowhere to print": (">&-", 0),
    "nowhere to complain": ("2>&-", 0),
    "a terminal of plain letters": ("", 0),
    "a full disk": ("> /dev/full", 2),
    "a reader that has seen enough": ("| head -1 > /dev/null; exit ${PIPESTATUS[0]}", 0),
}


@pytest.mark.parametrize(("how", "code"), SHELL_CASES.values(), ids=SHELL_CASES)
def test_whatever_the_shell_gives_it(healthy: Path, how: str, code: int) -> None:
    """1 would say that a critical alarm was raised."""
    command = f'{sys.executable} -m server check "{healthy}" --duration 2 {how}'
    plain = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii"}
    ended = subprocess.run(["bash", "-c", command], capture_output=True, env=plain, cwd=PROJECT)
    assert ended.returncode == code
    assert b"Traceback" not in ended.stderr


def test_a_fault_of_its_own_is_not_taken_for_an_alarm(
    check: Checking, healthy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(summary, "text", lambda report: 1 / 0)
    ending = check(healthy, "--duration", "2")
    assert ending.code == 2
    assert ending.err.endswith(
        "catgraph check: internal error of catgraph, please report it: ZeroDivisionError: division by zero\n"
    )


# The command with a progress that is eager to speak: the drive is too short for one.
_SLOW = """
import sys
from server.cli import progress
progress.FIRST_AFTER_S = progress.EVERY_S = 0.0
from server.cli.main import main
if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
"""
