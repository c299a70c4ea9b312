"""The page of `biotac view` as a browser gets it: all files, then rows of every finger. Also a program, which ends
with an error if something is missing (tools/wheel).
"""

import json
import re
from contextlib import closing
from typing import Any
from urllib.request import urlopen

from biotac.view.serving import Viewing
from biotac.view.state import PageState


def health(state: PageState) -> dict[str, Any]:
    """What a page that is opened now is told besides rows."""
    return json.loads(state.wait(state.cursor(), 0))["health"]


def fingers_shown(source: str) -> set[int]:
    """Serve ``source``, fetch the page and all files that it names, and read until five fingers sent."""
    with closing(Viewing(source, port=0)) as viewing:
        wanted, fetched, seen = {"index.html"}, set(), set()
        while wanted:
            name = wanted.pop()
            text = urlopen(viewing.server.url + name).read().decode()
            fetched.add(name)
            wanted |= set(re.findall(r'(?:src="|href="|from "\./)(\w+\.\w+)"', text)) - fetched
        assert fetched == set(viewing.server.files), fetched ^ set(viewing.server.files)
        with urlopen(f"{viewing.server.url}events") as events:
            while len(seen) < 5:
                line = events.readline().decode()
                if line.startswith('data: {"frames"'):
                    seen |= {row[0] for row in json.loads(line.removeprefix("data: "))["frames"]}
    return seen


if __name__ == "__main__":
    assert fingers_shown("sim:press.toml?fingers=5&seconds=60") == set(range(5))
