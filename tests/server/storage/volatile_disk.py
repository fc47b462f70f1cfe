"""A disk with a volatile cache: a file that keeps its writes apart until they are flushed, served by the kernel's FUSE.

python -m tests.server.storage.volatile_disk IMAGE FOLDER  serves the file FOLDER/disk, at first a copy of IMAGE, and
prints "ready". For each line `SEED PATH` it writes what a loss of power would leave to PATH, and prints "cut": all that
was flushed, and of each later write some sectors, by chance. The rules of FUSE are those of linux/fuse.h.
"""

from __future__ import annotations

import ctypes
import errno
import os
import random
import select
import stat
import struct
import sys
from pathlib import Path

SECTOR = 512  # a disk writes a sector whole or not at all
LONGEST_WRITE = 128 * 1024
ROOT, DISK = 1, 2  # nodes
FORGET, INTERRUPT, BATCH_FORGET = 2, 36, 42  # requests that are not answered


class VolatileDisk:
    """`flushed`: what is on the disk; `newest`: what is read from it."""

    def __init__(self, content: bytes) -> None:
        self.flushed, self.newest = bytearray(content), bytearray(content)
        self._cached: list[tuple[int, bytes]] = []

    def write(self, at: int, data: bytes) -> None:
        self.newest[at : at + len(data)] = data
        self._cached.append((at, data))

    def flush(self) -> None:
        for at, data in self._cached:
            self.flushed[at : at + len(data)] = data
        self._cached.clear()

    def cut(self, seed: int) -> bytearray:
        """What is left without power: of what was not flushed some sectors, also later ones without earlier."""
        chance, left = random.Random(seed), bytearray(self.flushed)
        for begin, data in self._cached:
            for at in range(0, len(data), SECTOR):
                if chance.random() < 0.5:
                    left[begin + at : begin + at + SECTOR] = data[at : at + SECTOR]
        return left

    def answer(self, opcode: int, node: int, body: bytes) -> bytes | int:
        """What a request of the kernel is answered, or the number of an error."""
        match opcode:
            case 26:  # INIT
                flags = 1 | 1 << 5  # reads may overlap, writes may be larger than a page
                return struct.pack("<IIIIHHIIHHI28x", 7, 31, 65536, flags, 16, 12, LONGEST_WRITE, 1, 0, 0, 0)
            case 1:  # LOOKUP
                entry = struct.pack("<QQQQII", DISK, 0, 3600, 3600, 0, 0) + self._attributes(DISK)
                return entry if body.rstrip(b"\0") == b"disk" else errno.ENOENT
            case 3 | 4:  # GETATTR, SETATTR
                return struct.pack("<QII", 3600, 0, 0) + self._attributes(node)
            case 14 | 27:  # OPEN, OPENDIR
                return struct.pack("<QIi", 0, 0, 0)
            case 15:  # READ
                _, at, size = struct.unpack_from("<QQI", body)
                return bytes(self.newest[at : at + size])
            case 16:  # WRITE
                _, at, size = struct.unpack_from("<QQI", body)
                self.write(at, body[40 : 40 + size])
                return struct.pack("<II", size, 0)
            case 17:  # STATFS
                return struct.pack("<QQQQQIIII24x", 1 << 20, 0, 0, 2, 0, 4096, 255, 4096, 0)
            case 20:  # FSYNC
                self.flush()
                return b""
            case 18 | 25 | 29 | 38:  # RELEASE, FLUSH, RELEASEDIR, DESTROY
                return b""
        return errno.ENOSYS

    def _attributes(self, node: int) -> bytes:
        size, mode = (len(self.newest), stat.S_IFREG | 0o600) if node == DISK else (0, stat.S_IFDIR | 0o700)
        times = (0,) * 6
        return struct.pack("<QQQ3Q3IIIIIIII", node, size, size // 512, *times, mode, 1, 0, 0, 0, 4096, 0)


def mounted_fuse(folder: Path) -> int:
    """The descriptor at which requests for `folder` come. Raises OSError."""
    fuse = os.open("/dev/fuse", os.O_RDWR)
    options = f"fd={fuse},rootmode=40000,user_id=0,group_id=0".encode()
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mount(b"volatile", os.fsencode(folder), b"fuse", 0, options) != 0:
        raise OSError(ctypes.get_errno(), f"no FUSE: {os.strerror(ctypes.get_errno())}")
    return fuse


def serve_one(fuse: int, disk: VolatileDisk) -> bool:
    """Answers one request; False: the file system is not mounted any more."""
    try:
        request = os.read(fuse, LONGEST_WRITE + 65536)
    except OSError as why:
        return why.errno in (errno.ENOENT, errno.EINTR, errno.EAGAIN)
    _, opcode, unique, node = struct.unpack_from("<IIQQ", request)
    if opcode not in (FORGET, INTERRUPT, BATCH_FORGET):
        answer = disk.answer(opcode, node, request[40:])
        body, error = (b"", -answer) if isinstance(answer, int) else (answer, 0)
        os.write(fuse, struct.pack("<IiQ", 16 + len(body), error, unique) + body)
    return True


def main() -> None:
    image, folder = map(Path, sys.argv[1:])
    disk = VolatileDisk(image.read_bytes())
    fuse = mounted_fuse(folder)
    print("ready", flush=True)
    while True:
        ready, _, _ = select.select([fuse, sys.stdin], [], [])
        if fuse in ready and not serve_one(fuse, disk):
            return
        if sys.stdin in ready:
            line = sys.stdin.readline()
            if not line:
                return
            seed, path = line.split(maxsplit=1)
            Path(path.strip()).write_bytes(disk.cut(int(seed)))
            print("cut", flush=True)


if __name__ == "__main__":
    main()
