"""`catgraph demo` as a process: it names a next step, and the step works."""

from __future__ import annotations

import argparse
import asyncio
import sys
from pathlib import Path

import pytest

from server.app.banner import pair_command
from server.app.config import default_data
from server.cli import demo
from server.cli.demo import next_steps
from tests.tree import PROJECT


@pytest.mark.parametrize(
    ("host", "program", "printed"),
    [
        ("127.0.0.1", ".venv/bin/catgraph", "start `.venv/bin/catgraph demo --host 0.0.0.0`"),
        ("127.0.0.1", "/x/server/__main__.py", " -m server demo --host 0.0.0.0`"),
        ("0.0.0.0", "catgraph", "pair it as described above"),
    ],
)
def test_a_phone_gets_in_by_what_is_printed(host: str, program: str, printed: str) -> None:
    assert printed in next_steps(host, program)[-1]


def parsed(*given: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    demo.add_arguments(parser)
    return parser.parse_args(given)


def test_it_records_into_a_folder_of_its_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    data = parsed().data
    assert data.parent == tmp_path
    assert data != default_data()
    assert not data.is_relative_to(default_data()), "no simulated drive among those of real cars"
    assert parsed("--data", str(tmp_path / "x")).data == tmp_path / "x"
    assert str(data / "recordings") in demo.records_into(data)
    assert pair_command(data) == f"catgraph pair --data {data}", "a phone is let in at the server of the demo"
    assert pair_command(default_data()) == "catgraph pair"


def test_the_readme_tries_it_with_one_command() -> None:
    text = (PROJECT / "README.md").read_text(encoding="utf-8")
    blocks = [block.strip() for block in text.split("```")[1::2]]
    assert blocks[0] == "make demo"
    assert blocks[1] == "make test"
    assert "serve" in blocks[2]


async def test_the_scenario_that_it_names_can_be_typed(tmp_path: Path) -> None:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "server", "demo", "--port", "0", "--data", str(tmp_path)),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
        cwd=PROJECT,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        async with asyncio.timeout(60):
            lines = [(await process.stdout.readline()).decode()]
            assert lines[0].startswith("catgraph listens on http://127.0.0.1:")
            while "Ctrl-C to stop" not in lines[-1]:
                lines.append((await process.stdout.readline()).decode())
            assert f"  It records into {tmp_path}/recordings; remove {tmp_path} when you are done.\n" in lines
            (step,) = (line for line in lines if "An alarm:" in line)
            process.stdin.write(f"{step.split('`')[1]}\n".encode())
            assert (await process.stdout.readline()).decode() == "speeding started for 20 s.\n"
    finally:
        process.kill()
        await process.wait()
