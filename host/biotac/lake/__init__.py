"""A lake: recordings by the thousand as Parquet files that DuckDB, Polars, Dask, Spark and pandas read as they are.

``DIR/TOPIC/board=SERIAL/date=YYYY-MM-DD/RECORDING.parquet``, a file a topic and recording; host/docs/lake.md describes
it. The file in ``recordings`` names and seals the others: it comes last, so what has none is not in the lake. Needs the
extra ``lake``.
"""

from __future__ import annotations
