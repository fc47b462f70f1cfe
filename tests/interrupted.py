"""How a process ends that Ctrl-C interrupted."""

import signal

# CPython ends by the signal itself, with a handler's status already set, where it interrupted an exec() of text, as
# dataclasses use it while a module is imported. To a shell both are 130.
INTERRUPTED = (130, -signal.SIGINT)
