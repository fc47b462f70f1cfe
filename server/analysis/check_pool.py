"""Several recordings checked at once, each in a process of its own, on all cores.

A process of its own for each: one that is killed or runs out of memory costs its own recording only.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Iterator, Sequence
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any

from server.analysis.check_recording import CANNOT, Checked, CheckOptions, OnProgress, check_recording

AHEAD = 2  # recordings that are begun for each core before the first of them is given out: bounds what is held


def cores() -> int:
    """How many processes can run at once."""
    with contextlib.suppress(AttributeError):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def check_each(
    recordings: Sequence[Sequence[Path]], options: CheckOptions, on_progress: OnProgress
) -> Iterator[Checked]:
    """Check recordings, each in one or several files, and yield their results in their order.

    `on_progress` receives the part of all bytes that is done, and the seconds of recordings judged. Closing the
    iterator ends the processes.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    resource_tracker.ensure_running()  # which unblocks Ctrl-C for itself
    with _ctrl_c_later():
        forkserver.ensure_running()
    workers = min(cores(), len(recordings))
    running: dict[Any, tuple[int, ForkServerProcess]] = {}  # by our end of its pipe
    found: dict[int, Checked] = {}
    sizes = [max(1, sum(map(_size, files))) for files in recordings]
    done: dict[int, tuple[float, float]] = {}  # part, seconds
    begun = given = 0
    try:
        while given < len(recordings):
            while begun < len(recordings) and len(running) < workers and begun < given + AHEAD * workers:
                ours, theirs = context.Pipe(duplex=False)
                process = context.Process(
                    target=_work, args=(theirs, recordings[begun], options, 1.0 / workers), daemon=True
                )
                with _ctrl_c_later():
                    process.start()
                    running[ours] = (begun, process)
                theirs.close()
                begun += 1
            ready: list[Any] = wait(list(running))
            for end in ready:
                number, process = running[end]
                try:
                    news = end.recv()
                except (EOFError, OSError):  # it ended, perhaps in the middle of a message
                    process.join()
                    del running[end]
                    end.close()
                    found.setdefault(number, _ended(recordings[number], process))
                    continue
                if isinstance(news, Checked):
                    found[number] = news
                else:
                    done[number] = news
                    part = sum(sizes[n] * part for n, (part, _) in done.items()) / sum(sizes)
                    on_progress(part, sum(judged_s for _, judged_s in done.values()))
            while given in found:
                yield found.pop(given)
                given += 1
    finally:
        for _, process in running.values():
            process.terminate()
        for _, process in running.values():
            process.join()


@contextlib.contextmanager
def _ctrl_c_later() -> Iterator[None]:
    """Ctrl-C waits: a process that is started in here is started whole, and does not see the signal itself."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _size(path: Path) -> int:
    """The size of a file or folder [B]; 0 where it cannot be read."""
    try:
        return path.stat().st_size if not path.is_dir() else sum(one.stat().st_size for one in path.rglob("*"))
    except OSError:
        return 0


def _ended(files: Sequence[Path], process: ForkServerProcess) -> Checked:
    return Checked(
        code=CANNOT, errors=(f"{files[0]}: the process that checked it ended with status {process.exitcode}.",)
    )


def _work(theirs: Connection[Any, Any], files: Sequence[Path], options: CheckOptions, memory_part: float) -> None:
    """In the process. Ctrl-C at the terminal ends its parent, which ends it; so does a pipe without a reader."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def send(news: Checked | tuple[float, float]) -> None:
        try:
            theirs.send(news)
        except BrokenPipeError:
            raise SystemExit(1) from None

    send(check_recording(files, options, lambda part, judged_s: send((part, judged_s)), memory_part=memory_part))
