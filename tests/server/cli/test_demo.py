"""`catgraph demo` as a process: it names a next step, and the step works."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

import pytest

from server.cli.demo import next_steps
from tests.tree import PROJECT


@pytest.mark.parametrize(
    ("host", "program", "said"),
    [
        ("127.0.0.1", ".venv/bin/catgraph", "start `.venv/bin/catgraph demo --host 0.0.0.0`"),
        ("127.0.0.1", "/x/server/__main__.py", " -m server demo --host 0.0.0.0`"),
        ("0.0.0.0", "catgraph", "pair it as described above"),
    ],
)
def test_a_phone_gets_in_by_what_is_printed(host: str, program: str, said: str) -> None:
    assert said in next_steps(host, program)[-1]


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
            (step,) = (line for line in lines if "An alarm:" in line)
            process.stdin.write(f"{step.split('`')[1]}\n".encode())
            assert (await process.stdout.readline()).decode() == "speeding started for 20 s.\n"
    finally:
        process.kill()
        await process.wait()
