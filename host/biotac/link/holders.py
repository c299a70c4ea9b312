"""Which programs have a port open: from /proc on Linux, unknown elsewhere."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

PROC = Path("/proc")


@dataclass(frozen=True)
class Holder:
    """A program that has the port open."""

    pid: int
    name: str

    def __str__(self) -> str:
        return "this program itself" if self.pid == os.getpid() else f"{self.name} (process {self.pid})"


def holders(path: str, proc: Path = PROC) -> list[Holder]:
    """Programs that have ``path`` open, as far as this user may see: other users' processes hide their files."""
    target = os.path.realpath(path)
    found = []
    for process in sorted(proc.glob("[0-9]*"), key=lambda p: p.name):
        # A process may end while it is looked at.
        with suppress(OSError):
            if any(_leads_to(fd, target) for fd in (process / "fd").iterdir()):
                found.append(Holder(int(process.name), (process / "comm").read_text(errors="replace").strip()))
    return found


def holders_text(found: list[Holder]) -> str:
    """The holders as text for use in a sentence."""
    return ", ".join(map(str, found)) if found else "another program"


def _leads_to(fd: Path, target: str) -> bool:
    try:
        return os.readlink(fd) == target
    except OSError:
        return False
