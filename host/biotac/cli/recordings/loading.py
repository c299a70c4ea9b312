"""Loading a recording as several verbs do: with a progress line, and with damage and gaps on stderr."""

from __future__ import annotations

from pathlib import Path

from ...errors import printable
from ...recording.reader import Recording
from ..outputs import note
from ..progress import Progress


def is_recording(where: str) -> bool:
    """Whether it is a recording's file, not a PORT, as replay:REC is."""
    return Path(where).is_file() or is_named_as_recording(where)


def is_named_as_recording(where: str) -> bool:
    """Whether it is a recording by name, where other files may be meant, too."""
    return where.lower().endswith(".mcap") and not where.startswith("replay:")


def load(path: Path, *, quiet: bool = False) -> Recording:
    """The recording at ``path``; with ``quiet`` the caller prints the problems."""
    with Progress() as progress:
        recording = Recording(path, lambda share: progress.show(f"reading {path}: {share:.0%}"))
    if not quiet:
        for problem in recording.problems:
            note(printable(problem))
    return recording


def code(recording: Recording) -> int:
    """The exit code of a verb that is done with it: 1 where the file is damaged, as stderr says."""
    return 1 if recording.damage else 0
