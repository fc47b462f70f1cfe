"""`catgraph verify`: the hash chain of recordings, and where it breaks."""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import signal
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import orjson

from server.analysis.check_pool import cores
from server.analysis.report_text import printable
from server.cli.progress import Progress
from server.recording.chain_neighbours import Beside
from server.recording.folder import FINISHED, WRITING
from server.recording.verification import Verification, compared, verification
from server.recording.verify import Verified, verify

INTACT, BROKEN, CANNOT = 0, 1, 2
_TRASH = ".trash"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help="recording of catgraph (.mcap), or a folder of them"
    )
    parser.add_argument("--json", action="store_true", help="print the results as JSON")


def run(args: argparse.Namespace) -> int:
    """Return 0: all are intact; 1: one is broken or unfinished, or does not match the one beside it; 2: one cannot be
    verified, and none is broken."""
    files = list(_files(args.files))
    if not files:
        print("catgraph verify: there is no recording in that folder.", file=sys.stderr)
        return CANNOT
    rows: list[dict[str, Any]] = []
    codes = set()
    with contextlib.suppress(BrokenPipeError):  # who read the other end of a pipe has seen enough
        for path, found in zip(files, _verified(files), strict=True):
            codes.add(BROKEN if found.is_broken else INTACT if found.file.state == "intact" else CANNOT)
            rows.append({"file": str(path), **found.as_json()})
            if not args.json:
                print(f"{printable(str(path))}: {printable(found.sentence, 1000)}", flush=True)
        if args.json:
            print(orjson.dumps(rows, option=orjson.OPT_INDENT_2).decode(), flush=True)
    return BROKEN if BROKEN in codes else CANNOT if CANNOT in codes else INTACT


def _files(given: Sequence[Path]) -> Iterator[Path]:
    """The files, and of each folder its recordings."""
    for path in given:
        if path.is_dir():
            inside = (each for each in path.rglob("*") if each.name.endswith((FINISHED, WRITING)) and each.is_file())
            yield from sorted(each for each in inside if _TRASH not in each.relative_to(path).parts)
        else:
            yield path


def _verified(files: Sequence[Path]) -> Iterator[Verification]:
    """What became of each file, in the order given; several on all cores."""
    what = "Verifying" if len(files) == 1 else f"Verifying {len(files)} recordings"
    progress = Progress(what)
    beside: dict[Path, Beside] = {}  # by folder, read once
    try:
        if len(files) == 1:
            found = verification(files[0], on_progress=progress)
            progress.close()
            yield found
            return
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload([__name__])
        workers = min(cores(), len(files))
        pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_ignore_ctrl_c)
        try:
            jobs = [pool.submit(verify, path) for path in files]
            for number, (path, job) in enumerate(zip(files, jobs, strict=True)):
                progress(number / len(files))
                try:
                    by_itself = job.result()
                except BrokenProcessPool:
                    by_itself = Verified(state="unreadable", sentence="Cannot be read: the process that read it ended.")
                progress.close()
                folder = path.absolute().parent
                if folder not in beside:
                    beside[folder] = Beside(folder, files)
                yield compared(path, by_itself, beside[folder])
        finally:
            pool.shutdown(cancel_futures=True)
    finally:
        progress.close()


def _ignore_ctrl_c() -> None:
    """Ctrl-C at the terminal ends the parent, which ends its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
