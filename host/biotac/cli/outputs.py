"""Printing of a verb's results, and checks of the output paths: before minutes of work and not after."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import InputError, exists_error


def report(args: argparse.Namespace, facts: Any, text: str) -> None:
    """Print a result: the facts for --json, else the text."""
    print(json.dumps(facts) if args.json else text, flush=True)


def note(text: str) -> None:
    """Print a remark on stderr; stdout is for the result."""
    step(f"biotac: {text}")


def step(text: str) -> None:
    """Print the present or next step on stderr; a terminal that has closed changes nothing."""
    with contextlib.suppress(OSError):
        print(text, file=sys.stderr, flush=True)


def check_file(path: Path | None, *, overwrite: bool) -> None:
    """Raises InputError if the file, where one is named, exists and may not be overwritten."""
    if path is not None and path.exists() and not overwrite:
        raise exists_error(path)


def check(folder: Path, paths: Sequence[Path], *, overwrite: bool) -> None:
    """Raises InputError if a place in ``folder`` is named twice, or exists and may not be overwritten."""
    for path in paths:
        if paths.count(path) > 1:
            raise InputError(
                f"{path} would be written twice; name each finger once, and calibrate files of the same name with "
                "separate --out folders"
            )
        if path.exists() and not overwrite:
            raise exists_error(path)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is not a folder; choose another name")


def make_folder(folder: Path) -> None:
    """Make ``folder`` and its parents. Raises InputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be created ({error.strerror}); choose another folder") from error
