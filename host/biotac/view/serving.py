"""What is to be shown, and a server that shows it until it is closed."""

from __future__ import annotations

import threading
from pathlib import Path
from types import TracebackType

from ..errors import PortError
from ..recording import Recording
from . import DEFAULT_PORT
from .live import LivePlayer, writable
from .player import Opener
from .reader import Reader
from .recorded import RecordedPlayer
from .server import ViewServer
from .state import State

# A scenario repeats for that long without a seam; making more of it would keep people waiting.
SCENARIO_S = 120
RECORDING_SUFFIX = ".mcap"


class Viewing:
    """A page being served; use as a context manager.

    ``source`` is a PORT or a recording (.mcap). ``port``: of the page; None: the usual one, or any free one
    when that is taken. ``folder``: where recordings go. ``again``: what is over starts anew.

    Raises InputError or RecordingError for a source or folder that cannot be used, PortError when ``port``
    is taken. A board that is not there is waited for: the page says so.
    """

    def __init__(self, source: str, *, port: int | None = None, folder: Path | None = None, again: bool = True) -> None:
        opener = opener_of(source, writable(folder or Path()))
        self.state = State(source)
        self.reader = Reader(opener, self.state, again=again)
        self.server = serve(self.state, self.reader, port)
        self._thread = threading.Thread(target=self.server.serve_forever, name="biotac-view-http", daemon=True)
        self._thread.start()
        self.reader.start()

    @property
    def url(self) -> str:
        """Where the page is; with what commands need, which only its own reader is to have."""
        return f"{self.server.url}#{self.server.token}"

    def wait(self) -> None:
        """Wait for a failure, which is raised; there is no other end."""
        while not self.reader.over.wait(1.0):  # without a time Ctrl-C is not heard on Windows
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

    def __enter__(self) -> Viewing:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def serve(state: State, reader: Reader, port: int | None) -> ViewServer:
    """The server on ``port``, or on the usual or any other one."""
    if port is not None:
        return ViewServer(state, reader, port)
    try:
        # The usual one, so that a page left open finds its way back when the program runs again.
        return ViewServer(state, reader, DEFAULT_PORT)
    except PortError:
        return ViewServer(state, reader, 0)


def opener_of(source: str, folder: Path) -> Opener:
    """What opens ``source``; a recording is read now, once."""
    if source.endswith(RECORDING_SUFFIX):
        recording = Recording(source)
        return lambda: RecordedPlayer(recording)
    port = lasting(source)
    return lambda: LivePlayer(port, folder)


def lasting(port: str) -> str:
    """A simulated scenario that does not say how long, for a while longer than its own length."""
    head, _, options = port.partition("?")
    scenario = head.startswith("sim:") and head.endswith(".toml")
    if not scenario or "seconds=" in options:
        return port
    return f"{head}?{options}{'&' if options else ''}seconds={SCENARIO_S}"
