"""A lake: thousands of recordings as Parquet files that DuckDB, Polars, Dask, Spark and pandas read directly.

There is one file per topic and recording, ``DIR/TOPIC/board=SERIAL/date=YYYY-MM-DD/RECORDING.parquet``, and a list of
their checksums, ``DIR/SHA256SUMS``; see host/docs/guides/lake.md. Needs the extra ``lake``.
"""
