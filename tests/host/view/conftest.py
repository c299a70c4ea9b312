"""The page in headless Chromium, and players driven by a test."""

import os
import queue
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import biotac
from biotac.view.player import Opener
from biotac.view.serving import Viewing
from biotac.wire.batches import Batch, LinkStats, join

CHROMIUM = shutil.which("chromium")
PATIENCE_MS = 300_000  # only a failing test waits so long


class ScriptedPlayer:
    """Yields the items of ``script``: batches, or an error to raise; None ends it. Notes every command."""

    paused = False
    applied_n = staticmethod(lambda *rows: None)

    def __init__(self, *, live: bool = True) -> None:
        self.live = live
        self.board = "a scripted board"
        self.script: queue.Queue[Batch | Exception | None] = queue.Queue()
        self.commands: list[tuple[str, int | None]] = []
        self.refusal: Exception | None = None
        self.closed = False

    def batches(self) -> Iterator[Batch]:
        while True:
            try:
                item = self.script.get(timeout=0.02)
            except queue.Empty:
                yield join([])
                continue
            if item is None:
                return
            if isinstance(item, Exception):
                raise item
            yield item

    def stats(self) -> LinkStats:
        return LinkStats(0, 0, frames_lost=7, pac_lost=0, disordered=0, crc_errors=3, other_errors=0)

    def recording(self) -> None:
        return None

    def position(self) -> tuple[None, float]:
        return None, 1.0

    def do(self, command: str, finger: int | None, value: float | str | None = None) -> str:
        self.commands.append((command, finger))
        if self.refusal is not None:
            raise self.refusal
        return "done as asked"

    def close(self) -> None:
        self.closed = True


@pytest.fixture(scope="session")
def make_player() -> type[ScriptedPlayer]:
    """Makes players for ``view_of``."""
    return ScriptedPlayer


@pytest.fixture(scope="session")
def touch() -> Batch:
    """A second of two fingers from the simulated board, both pressed."""
    with biotac.open("sim:press.toml?fingers=2&seconds=3") as hand:
        return hand.read_batch(10)


@pytest.fixture
def view(tmp_path: Path) -> Iterator[Callable[..., Viewing]]:
    """Serves a source; recordings go to tmp_path. Closed after the test."""
    served: list[Viewing] = []

    def serve(source: str, **options: Any) -> Viewing:
        served.append(Viewing(source, **{"port": 0, "folder": tmp_path} | options))
        return served[-1]

    yield serve
    for view in served:
        view.close()


@pytest.fixture
def view_of(view, monkeypatch) -> Callable[..., Viewing]:
    """Serves the opener's source."""

    def serve(opener: Opener, retry_s: float = 0.02, **options: Any) -> Viewing:
        monkeypatch.setattr("biotac.view.serving.opener_of", lambda source, folder: opener)  # no port plays a script
        monkeypatch.setattr("biotac.view.reader.RETRY_S", retry_s)  # a second each, and one page must not see it
        return view("scripted", **options)

    return serve


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Debian's Chromium without a window."""
    missing = None
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing = "Playwright's Python package is missing: pip install 'biotac-gateway[test]'"
    if CHROMIUM is None:
        missing = "chromium is missing: apt-get install chromium"
    if missing:
        if os.environ.get("BIOTAC_CI"):
            pytest.fail(missing)
        pytest.skip(missing)
    with sync_playwright() as playwright:
        # In a container Chromium has no user name spaces for a sandbox; it shows only our own page.
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def open_page(browser) -> Iterator[Callable[..., Any]]:
    """Opens a page; an error in the page's log, or a request to another place, fails the test."""
    contexts: list[Any] = []
    problems: list[str] = []
    expected: list[str] = []

    def open_it(viewing: Viewing, *, expect: str = "", **options: Any) -> Any:
        context = browser.new_context(**{"viewport": {"width": 1400, "height": 900}} | options)
        context.set_default_timeout(PATIENCE_MS)
        contexts.append(context)
        if expect:
            expected.append(expect)
        page = context.new_page()
        page.on("console", lambda m: problems.append(m.text) if m.type in ("error", "warning") else None)
        page.on("pageerror", lambda e: problems.append(str(e)))
        page.on(
            "request", lambda r: None if r.url.startswith(viewing.server.url) else problems.append(f"asked for {r.url}")
        )
        page.goto(viewing.url)
        return page

    yield open_it
    for context in contexts:
        context.close()
    assert [p for p in problems if not any(words in p for words in expected)] == []
