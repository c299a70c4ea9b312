"""SQL queries on a lake with DuckDB: one view per topic."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import duckdb

from ..errors import InputError
from .folder import Lake

# Stated explicitly, or a serial number of digits alone would be read as a number and lose its leading zeros.
_TYPES = "hive_types = {'board': VARCHAR, 'date': DATE}"


def query(lake: Lake, text: str) -> tuple[list[str], Iterator[tuple[Any, ...]]]:
    """Run a query; return the names of the result's columns, and an iterator over its rows.

    Each topic is a view over the complete recordings. Raises InputError for what DuckDB refuses.
    """
    connection = duckdb.connect(":memory:")
    connection.execute("SET TimeZone = 'UTC'")
    try:
        for topic in sorted(lake.topics):
            paths = ", ".join("'" + str(path).replace("'", "''") + "'" for path in lake.paths(topic))
            connection.execute(
                f"CREATE VIEW {topic} AS SELECT * FROM read_parquet([{paths}], hive_partitioning = true, {_TYPES})"
            )
        result = connection.execute(text)
    except duckdb.Error as error:
        known = ", ".join(sorted(lake.topics))
        raise InputError(
            f"DuckDB rejects the query: {_reason(error)}; topics are {known}; the query 'DESCRIBE TOPIC' lists columns"
        ) from error
    names = [column[0] for column in result.description or ()]
    return names, _rows(result)


def _rows(result: Any) -> Iterator[tuple[Any, ...]]:
    try:
        while rows := result.fetchmany(10_000):
            yield from rows
    except duckdb.Error as error:
        raise InputError(
            f"DuckDB stopped: {_first_line(error)}; look for damaged files with `biotac lake check`"
        ) from error


def _reason(error: Exception) -> str:
    """DuckDB's sentences, such as the columns that there are, without the query that follows them."""
    said, *_ = str(error).partition("\nLINE ")
    return "; ".join(line.rstrip("!") for line in said.splitlines() if line).replace(": :", ":")


def _first_line(error: Exception) -> str:
    return str(error).strip().splitlines()[0]
