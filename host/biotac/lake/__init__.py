"""A lake: thousands of recordings as Parquet files that DuckDB, Polars, Dask, Spark and pandas read directly.

There is one file per topic and recording, ``DIR/TOPIC/board=SERIAL/date=YYYY-MM-DD/RECORDING.parquet``; see
host/docs/lake.md. A recording's file in ``recordings`` lists and seals its other files. It is written last, so a
recording without it is not in the lake. Needs the extra ``lake``.
"""

from __future__ import annotations
