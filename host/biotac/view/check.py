"""Testing the page without a browser: whether all files are there, and whether its data are right."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from html.parser import HTMLParser
from http.client import HTTPConnection, HTTPResponse
from itertools import pairwise
from typing import Any

from .server import TOKEN_HEADER
from .serving import Viewing

SOURCE = "sim:press.toml?fingers=5&seconds=60"
ROUNDS = 20
PATIENCE_S = 300.0


@dataclass(frozen=True)
class Checked:
    """Result of the check. ``problems``: in words, empty if all is well."""

    files: int
    bytes: int
    fingers: int
    frames: int
    problems: list[str]


def check() -> Checked:
    """Serve a simulated hand of five fingers, fetch the page with all its files, and the first rounds of frames."""
    problems: list[str] = []
    with Viewing(SOURCE, port=0) as viewing:
        port = viewing.server.server_port
        names = linked(get(port, "/").decode())
        sizes = [len(get(port, "/"))] + [len(get(port, f"/{name}")) for name in names]
        missing = sorted(set(viewing.server.files) - set(names) - {"index.html"} - imported(viewing.server.files))
        problems += [f"nothing uses {name}" for name in missing]
        about, frames = first_frames(port)
        problems += judge(about, frames)
        problems += judge_commands(port, viewing.server.token)
        seen = {row["finger"] for row in frames}
        return Checked(len(viewing.server.files), sum(sizes), len(seen), len(frames), problems)


@contextmanager
def asked(port: int, what: str, path: str, body: str | None = None, **headers: str) -> Iterator[HTTPResponse]:
    """The response to a request."""
    with closing(HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)) as connection:
        connection.request(what, path, body, headers)
        yield connection.getresponse()


def get(port: int, path: str) -> bytes:
    """Body of a page. Raises ConnectionError if it is not there."""
    with asked(port, "GET", path) as answer:
        if answer.status != 200:
            raise ConnectionError(f"{path} returned HTTP status {answer.status}")
        return answer.read()


class _Links(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.names: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        wanted = {"script": "src", "link": "href", "img": "src"}.get(tag)
        self.names += [value for key, value in attrs if key == wanted and value]


def linked(html: str) -> list[str]:
    """Files that a page loads."""
    parser = _Links()
    parser.feed(html)
    return parser.names


def imported(files: dict[str, bytes]) -> set[str]:
    """Modules that another module imports."""
    code = b"".join(body for name, body in files.items() if name.endswith(".js")).decode()
    return {name for name in files if f'"./{name}"' in code}


def first_frames(port: int) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The stream's first event, and about ROUNDS frames of every finger."""
    about: dict[str, Any] = {}
    rows: list[dict[str, Any]] = []
    deadline_s = time.monotonic() + PATIENCE_S
    for name, data in events(port):
        if name == "about":
            about = data
        else:
            rows += [dict(zip(about["frame_row"], row, strict=True)) for row in data["frames"]]
        if len(rows) >= ROUNDS * about["fingers"] or time.monotonic() > deadline_s:
            break
    return about, rows


def events(port: int) -> Iterator[tuple[str, Any]]:
    """Name and JSON data of server-sent events, as they come."""
    with asked(port, "GET", "/events", Accept="text/event-stream") as answer:
        name = "message"
        while line := answer.readline().decode().rstrip("\n"):
            if line.startswith("event: "):
                name = line.removeprefix("event: ")
            elif line.startswith("data: "):
                yield name, json.loads(line.removeprefix("data: "))
                name = "message"
                answer.readline()
            elif line.startswith(":"):
                answer.readline()


def judge(about: dict[str, Any], frames: list[dict[str, Any]]) -> list[str]:
    """Problems with the first frames, in words."""
    problems = []
    electrodes = len(about["electrodes"])
    for finger in range(about["fingers"]):
        mine = [row for row in frames if row["finger"] == finger]
        if not mine:
            problems.append(f"finger {finger} sent nothing")
        steps = {b["seq"] - a["seq"] for a, b in pairwise(mine)}
        if min(steps, default=1) < 1:  # larger steps are fine: a busy computer loses frames, which the page counts
            problems.append(f"finger {finger}: sequence numbers step by {sorted(steps)}, expected 1 or more")
        if any(len(row["signal_q4"]) != electrodes for row in mine):
            problems.append(f"finger {finger}: a frame does not have {electrodes} electrodes")
    return problems


def judge_commands(port: int, token: str) -> list[str]:
    """Problems with commands, in words: a stranger's must be refused, our own answered."""
    problems = []
    for what, headers, wanted in (
        ("without the page's token", {}, {403}),
        ("from another origin", {TOKEN_HEADER: token, "Origin": "http://example.org"}, {403}),
        # the board refuses (409) while the finger moves
        ("from the page", {TOKEN_HEADER: token}, {200, 409}),
    ):
        status = post(port, {"do": "tare", "finger": 0}, headers)
        if status not in wanted:
            problems.append(f"a command {what} returned HTTP status {status}")
    return problems


def post(port: int, wish: dict[str, Any], headers: dict[str, str]) -> int:
    """HTTP status of a command."""
    headers = {"Content-Type": "application/json"} | headers
    with asked(port, "POST", "/command", json.dumps(wish), **headers) as answer:
        return answer.status
