"""What a person names as output: files are replaced, links kept, devices and pipes written into and never replaced."""

from __future__ import annotations

import errno
import os
import socket
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from server.storage.output_file import output_of, write, writing
from tests.server.recording.bags import Drive, write_ros2
from tests.tree import PROJECT

pytestmark = pytest.mark.world(n=26)


@pytest.fixture
def null(tmp_path: Path) -> Path:
    """A device like /dev/null, never the machine's own."""
    path = tmp_path / "null"
    try:
        os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
        path.write_bytes(b"x")
    except OSError as why:
        pytest.skip(f"no device can be made here: {why.strerror}")
    return path


def test_a_new_file_and_an_old_one_are_written_whole(tmp_path: Path) -> None:
    out = tmp_path / "out.json"
    write(output_of(out), b"one")
    out.chmod(0o640)
    write(output_of(out), b"two")
    assert out.read_bytes() == b"two"
    assert stat.S_IMODE(out.stat().st_mode) == 0o640

    def break_off() -> None:
        with writing(output_of(out)) as new:
            new.write_bytes(b"half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        break_off()
    assert out.read_bytes() == b"two"
    assert [path.name for path in tmp_path.iterdir()] == ["out.json"]


def test_a_link_is_kept_and_its_file_replaced(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    for name in ("there", "not there yet"):
        target, link = tmp_path / "far" / name, tmp_path / f"link to {name}"
        link.symlink_to(target)
        if name == "there":
            target.write_bytes(b"old")
        (again := tmp_path / f"link to link to {name}").symlink_to(link.name)
        write(output_of(again), b"new")
        assert link.is_symlink()
        assert again.is_symlink()
        assert target.read_bytes() == b"new"


def test_a_device_stays_a_device(null: Path, tmp_path: Path) -> None:
    before = os.stat(null)
    (tmp_path / "link").symlink_to(null)
    for path in (null, tmp_path / "link"):
        write(output_of(path), b"gone")
    assert os.stat(null).st_rdev == before.st_rdev
    assert os.stat(null).st_ino == before.st_ino
    assert stat.S_ISCHR(os.stat(null).st_mode)


def test_a_full_device_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "full"
    try:
        os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 7))
        path.open("ab").close()
    except OSError as why:
        pytest.skip(f"no device can be made here: {why.strerror}")
    with pytest.raises(OSError, match="No space left") as refused:
        write(output_of(path), b"x" * 10_000)
    assert refused.value.errno == errno.ENOSPC
    assert stat.S_ISCHR(os.stat(path).st_mode)


def test_a_named_pipe_is_written_into(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    found: list[bytes] = []
    reader = threading.Thread(target=lambda: found.append(pipe.read_bytes()))
    reader.start()
    write(output_of(pipe), b"x" * 300_000)
    reader.join(20)
    assert found == [b"x" * 300_000]
    assert stat.S_ISFIFO(os.stat(pipe).st_mode)


@pytest.mark.parametrize("name", ["/dev/fd/{}", "/proc/self/fd/{}"])
def test_our_own_descriptors_are_written_into(name: str, tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    with kept.open("wb") as file:
        file.write(b"before ")
        file.flush()
        before = os.stat(kept).st_ino
        write(output_of(Path(name.format(file.fileno()))), b"and after")
        (tmp_path / "link").symlink_to(name.format(file.fileno()))
        write(output_of(tmp_path / "link"), b", twice")
    assert kept.read_bytes() == b"before and after, twice"
    assert os.stat(kept).st_ino == before


def test_what_cannot_be_written_is_refused_before_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "loop").symlink_to("loop")
    with socket.socket(socket.AF_UNIX) as listening:
        monkeypatch.chdir(tmp_path)
        listening.bind("socket")
        for path in (tmp_path, tmp_path / "loop", tmp_path / "socket", tmp_path / "no" / "x", Path("/dev/fd/987")):
            with pytest.raises(OSError):  # noqa: PT011
                output_of(path)


def test_a_disk_is_never_written(tmp_path: Path) -> None:
    path = tmp_path / "disk"
    try:
        os.mknod(path, 0o600 | stat.S_IFBLK, os.makedev(7, 250))  # a loop device that nobody has
    except OSError as why:
        pytest.skip(f"no device can be made here: {why.strerror}")
    with pytest.raises(OSError, match="it is a disk"):
        output_of(path)


# -- the commands ---


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    twist = {"linear": {"x": 3.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}
    rows = [(n / 20, "/catvehicle/vel", "geometry_msgs/msg/Twist", twist) for n in range(100)]
    return write_ros2(tmp_path_factory.mktemp("drive") / "drive", Drive(messages=rows))


def shell(script: str, drive: Path, folder: Path) -> subprocess.CompletedProcess[bytes]:
    catgraph = f"{sys.executable} -m server"
    environment = {**os.environ, "PYTHONPATH": str(PROJECT), "DRIVE": str(drive), "CATGRAPH": catgraph}
    return subprocess.run(["bash", "-c", script], cwd=folder, env=environment, capture_output=True, timeout=100)


def test_check_writes_into_whatever_the_shell_gives_it(drive: Path, tmp_path: Path, null: Path) -> None:
    done = shell(
        """
        mkfifo pipe; cat pipe > from_pipe & ln -s real.html link.html
        $CATGRAPH check $DRIVE --json pipe --html link.html > text || exit 10; wait
        $CATGRAPH check $DRIVE --json >(cat > from_substitution) --html null > /dev/null || exit 11
        { echo first; $CATGRAPH check $DRIVE --json /dev/stdout; echo last; } > all || exit 12
        $CATGRAPH check $DRIVE --json /dev/stdout | cat > piped || exit 13
        $CATGRAPH check $DRIVE --html /dev/stdout --json null > page.html || exit 14
        for n in 1 2 3 4 5 6 7 8 9 10; do test -s from_substitution && break; sleep 0.2; done
        """,
        drive,
        tmp_path,
    )
    assert done.returncode == 0, done.stderr.decode()
    for name in ("from_pipe", "from_substitution", "piped"):
        assert (tmp_path / name).read_bytes().startswith(b"{\n"), name
    lines = (tmp_path / "all").read_text().splitlines()
    assert (lines[0], lines[1], lines[-1]) == ("first", "{", "last")
    assert (tmp_path / "link.html").is_symlink()
    assert (tmp_path / "real.html").read_text().startswith("<!doctype html>")
    assert (tmp_path / "page.html").read_text().lower().startswith("<!doctype html>")
    assert stat.S_ISFIFO(os.stat(tmp_path / "pipe").st_mode)
    assert stat.S_ISCHR(os.stat(null).st_mode)


def test_export_writes_into_whatever_the_shell_gives_it(drive: Path, tmp_path: Path, null: Path) -> None:
    done = shell(
        """
        mkfifo pipe; cat pipe > from_pipe & ln -s real.zip link.zip
        $CATGRAPH export $DRIVE --format csv --out pipe > text || exit 10; wait
        $CATGRAPH export $DRIVE --format csv --out /dev/stdout > from_stdout || exit 11
        $CATGRAPH export $DRIVE --format csv --out null || exit 12
        $CATGRAPH export $DRIVE --format csv --out link.zip || exit 13
        """,
        drive,
        tmp_path,
    )
    assert done.returncode == 0, done.stderr.decode()
    for name in ("from_pipe", "from_stdout", "real.zip"):
        assert (tmp_path / name).read_bytes().startswith(b"PK"), name
    assert (tmp_path / "link.zip").is_symlink()
    assert stat.S_ISFIFO(os.stat(tmp_path / "pipe").st_mode)
    assert stat.S_ISCHR(os.stat(null).st_mode)


def test_no_command_replaces_what_a_person_names_by_itself() -> None:
    checked = 0
    for path in (PROJECT / "server").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if any(f'add_argument("{name}", type=Path' in text for name in ("--out", "--json", "--html")):
            assert "os.replace" not in text, path
            assert "output_of" in text, path
            checked += 1
    assert checked == 2
