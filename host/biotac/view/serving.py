"""Serving the page for a source until it is closed."""

from __future__ import annotations

import shutil
import tempfile
import threading
import weakref
from pathlib import Path

from ..errors import PortError
from ..hand.opening import open as open_hand
from . import DEFAULT_PORT
from .overview import overview
from .player import Opener, Player, RecordingOpener, writable
from .reader import PageReader
from .server import ViewServer
from .state import PageState

# A scenario is repeated seamlessly for so long; generating more would make users wait.
SCENARIO_S = 120
RECORDING_SUFFIX = ".mcap"
ROUNDS_FILES = ("bag:", "csv:")


class Viewing:
    """A page being served until it is closed.

    ``source`` is a PORT or a recording (.mcap). ``port``: the page's TCP port; None: the default one, or any free one
    if that is taken. ``folder``: where recordings go. ``again``: start over after the end.

    Raises InputError or RecordingError for a recording or folder that cannot be used, PortError when ``port`` is
    taken. If the board is not there, the page says so and waits for it.
    """

    def __init__(self, source: str, *, port: int | None = None, folder: Path | None = None, again: bool = True) -> None:
        opener = opener_of(source, writable(folder or Path()))
        self.state = PageState(source)
        if isinstance(opener, RecordingOpener):
            self.state.recording = overview(opener.recording)
        self.reader = PageReader(opener, self.state, again=again)
        try:  # the default port first, so that an open page reconnects when the program runs again
            self.server = ViewServer(self.state, self.reader, DEFAULT_PORT if port is None else port)
        except PortError:
            if port is not None:
                raise
            self.server = ViewServer(self.state, self.reader, 0)
        self._thread = threading.Thread(target=self.server.serve_forever, name="biotac-view-http", daemon=True)
        self._thread.start()
        self.reader.start()

    @property
    def url(self) -> str:
        """The page's URL with the secret for commands; only for the user of this page."""
        return f"{self.server.url}#{self.server.token}"

    def wait(self) -> None:
        """Wait until the reader stops, and raise the error of a failure."""
        while not self.reader.over.wait(1.0):  # without a timeout, Ctrl-C does not work on Windows
            pass
        if self.reader.failure is not None:
            raise self.reader.failure

    def close(self) -> None:
        """Stop playing and serving; a recording is finished. Safe to call twice."""
        self.reader.stop()
        self.state.close()
        self.server.shutdown()
        self.server.server_close()
        self._thread.join()


def opener_of(source: str, folder: Path) -> Opener:
    """An opener for ``source``; a recording is read now, only once. A bag or a table is recorded first."""
    if source.startswith(ROUNDS_FILES):
        with open_hand(source) as hand:
            scratch = Path(tempfile.mkdtemp(prefix="biotac-view-"))
            with hand.record(scratch / "rounds.mcap"):
                hand.stream("results", "events")
                for _ in hand.batches():
                    pass
        opener = RecordingOpener(str(scratch / "rounds.mcap"), folder)
        weakref.finalize(opener, shutil.rmtree, scratch, ignore_errors=True)
        return opener
    if source.endswith(RECORDING_SUFFIX):
        return RecordingOpener(source, folder)
    port = lasting(source)
    return lambda: Player(open_hand(port, pace=1.0), folder)  # people watch, so simulated boards run in real time


def lasting(port: str) -> str:
    """``port``, with ``seconds=SCENARIO_S`` added for a simulated scenario without a length."""
    head, _, options = port.partition("?")
    scenario = head.startswith("sim:") and head.endswith(".toml")
    if not scenario or "seconds=" in options:
        return port
    return f"{head}?{options}{'&' if options else ''}seconds={SCENARIO_S}"
