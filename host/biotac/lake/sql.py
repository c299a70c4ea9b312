"""SQL queries on a lake with DuckDB: one view per topic."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import duckdb

from ..errors import InputError
from .folder import Lake

# From the end of the path: folders above the lake may be called anything. DuckDB's own partitions would name them, too.
_PARTITION = r"/board=([^/]+)/date=([^/]+)/[^/]+$"


def query(lake: Lake, text: str) -> tuple[list[str], Iterator[tuple[Any, ...]]]:
    """Run a query; return the names of the result's columns, and an iterator over its rows.

    Each topic is a view over the complete recordings. Raises InputError for what DuckDB refuses.
    """
    topics = lake.topics()
    connection = duckdb.connect(":memory:")
    connection.execute("SET TimeZone = 'UTC'")
    try:
        str(lake.folder.absolute()).encode()
        for topic, files in topics.items():
            paths = ", ".join("'" + str(path.absolute()).replace("'", "''") + "'" for path in files)
            connection.execute(
                f"CREATE VIEW {topic} AS SELECT * EXCLUDE (filename), "
                f"url_decode(regexp_extract(filename, '{_PARTITION}', 1)) AS board, "
                f"CAST(regexp_extract(filename, '{_PARTITION}', 2) AS DATE) AS date "
                f"FROM read_parquet([{paths}], filename = true, hive_partitioning = false)"
            )
        result = connection.execute(text)
    except UnicodeEncodeError as error:
        raise InputError(f"{lake.folder} has a name that is not UTF-8, which DuckDB cannot open; rename it") from error
    except duckdb.Error as error:
        known = ", ".join(sorted(topics))
        # Its sentences, such as the columns that there are, without the query that follows them.
        sentences = str(error).partition("\nLINE ")[0].splitlines()
        reason = "; ".join(line.rstrip("!") for line in sentences if line).replace(": :", ":")
        raise InputError(
            f"DuckDB rejects the query: {reason}; topics are {known}; the query 'DESCRIBE TOPIC' lists columns"
        ) from error
    names = [column[0] for column in result.description or ()]
    return names, _rows(result)


def _rows(result: Any) -> Iterator[tuple[Any, ...]]:
    try:
        while found := result.fetchmany(10_000):
            yield from found
    except duckdb.Error as error:
        first_line = str(error).strip().splitlines()[0]
        raise InputError(f"DuckDB stopped: {first_line}; look for damaged files with `biotac lake check`") from error
