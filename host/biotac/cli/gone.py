"""Old words of the command line, each with the new one: accepted for one version."""

from __future__ import annotations

LAKE = (
    "a lake is now plain Parquet: `biotac export RECS... DIR --partition` writes it, and DuckDB, Polars or Dask read "
    "it, as they do the folders of a lake (host/docs/guides/many_recordings.md)"
)
#: Verbs that are gone, each with the present way.
VERBS = {"lake": LAKE}
#: Verbs that still work, by another name.
RENAMED = {"calibration": "calibrate"}
