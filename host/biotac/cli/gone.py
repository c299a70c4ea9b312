"""Words that the command line no longer knows, each with what replaces it: told for one version."""

from __future__ import annotations

LAKE = (
    "a lake is now plain Parquet: `biotac export RECS... DIR --partition` writes it, and DuckDB, Polars or Dask read "
    "it, as they do the folders of a lake (host/docs/guides/many_recordings.md)"
)
VERBS = {"lake": LAKE}
