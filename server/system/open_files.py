"""Whether the process may still open files and connections: `ulimit -n` is a limit that attackers can fill."""

from __future__ import annotations

import errno
import os
import resource

KEPT_FREE = 32  # for the log, a recording, an export: below this it is said


class FilesExhausted(OSError):
    """Too few file descriptors are left; `str()` has the number."""


def demand_free() -> None:
    """Raises FilesExhausted where fewer than KEPT_FREE files can be opened. Takes some microseconds.

    The system gives the lowest number that is free: all below it are taken.
    """
    most, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    try:
        number = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        if error.errno not in (errno.EMFILE, errno.ENFILE):
            raise
        raise FilesExhausted(f"no file or connection can be opened: {most} are open, and no more are allowed") from None
    os.close(number)
    if most != resource.RLIM_INFINITY and number > most - KEPT_FREE:
        raise FilesExhausted(f"{most - number} more files and connections can be opened, of {most} (ulimit -n)")
