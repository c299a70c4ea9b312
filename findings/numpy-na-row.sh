#!/usr/bin/env bash
# numpy.loadtxt drops a row whose first cell is #N/A (as spreadsheets write a missing value) without a word: it is
# taken for a comment, also with quotechar. The rows after it move up. With comments=None it is refused.
# Seen with NumPy 2.4.6 on Python 3.11; fails where that has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6
"$folder/venv/bin/python" -W error - <<'END'
import numpy as np

rows = ["0.1,1", "#N/A,2", "0.3,3"]
seen = np.loadtxt(rows, delimiter=",", quotechar='"')
print(f"NumPy {np.__version__}: of 3 rows {len(seen)} are read, without a warning: {seen.tolist()}")
assert seen.tolist() == [[0.1, 1.0], [0.3, 3.0]]
try:
    np.loadtxt(rows, delimiter=",", comments=None)
except ValueError as error:
    print(f"with comments=None: {error}")
else:
    raise SystemExit("with comments=None it is read now")
END
