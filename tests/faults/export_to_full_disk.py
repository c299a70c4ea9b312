"""Run by test_exports.py: exports of a recording under growing limits of a file's size, as a disk that is nearly full.

    python export_to_full_disk.py RECORDING FOLDER SUFFIX SIZE...

A program that dies, as HDF5 did, dies in a process of its own. Prints two lines a size: the error or the name of
the file, and a list of the folder.
"""

import resource
import signal
import sys
from pathlib import Path

import biotac
from biotac.export import export


def main(path: str, folder: str, suffix: str, *sizes: str) -> None:
    recording = biotac.Recording(path)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # a write then fails with EFBIG
    _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    for size in sizes:
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(size), hard))
        try:
            written = export(recording, Path(folder) / f"out{suffix}")
        except biotac.InputError as error:
            print(f"{size} InputError {error}", flush=True)
        else:
            print(f"{size} wrote {len(written)}", flush=True)
        print(f"{size} left {sorted(its.name for its in Path(folder).iterdir())}", flush=True)


main(*sys.argv[1:])
