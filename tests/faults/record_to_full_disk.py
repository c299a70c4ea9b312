"""Run by test_full_recordings.py: recordings under limits of a file's size, as on a disk that fills up.

    python record_to_full_disk.py PORT FOLDER SIZE...

Prints a line of JSON a size: whether an OSError was raised, and the number of frames read until then.
"""

import json
import resource
import signal
import sys
from pathlib import Path

import biotac


def record(port: str, path: Path, size: int) -> dict[str, int]:
    answer = read = 0
    try:
        with biotac.open(port) as hand:  # opening writes another file first
            _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
            hand.record(path)
            for batch in hand.batches():
                read += len(batch.frames)
    except OSError:
        answer = 1
    return {"told": answer, "read": read}


def main(port: str, folder: str, *sizes: str) -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # a write then fails with EFBIG
    unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
    for size in sizes:
        print(json.dumps(record(port, Path(folder) / f"{size}.mcap", int(size))), flush=True)
        resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)


main(*sys.argv[1:])
