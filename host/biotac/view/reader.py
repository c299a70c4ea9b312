"""The thread that opens the source, plays it into the state, and reopens a source that went away."""

from __future__ import annotations

import threading

from ..errors import BiotacError, InputError, StreamTakenError
from .player import COMMANDS, Opener, Player, RecordingOpener
from .state import PageState

RETRY_S, OPEN_S = 1.0, 10.0  # OPEN_S: how long a command waits for the first attempt, or for the one after a seek


class PageReader:
    """Plays the source of ``opener`` into ``state``. ``again``: start over after the end."""

    def __init__(self, opener: Opener, state: PageState, *, again: bool) -> None:
        self._opener = opener
        self._state = state
        self._again = again
        self._loss = ""  # how the board was lost, while it is lost
        self._player: Player | None = None
        self._why_waiting = "it is being opened; try again"  # why nothing plays
        self._turn = threading.Lock()  # of commands, and of the player's coming and going
        self._tried = threading.Event()  # to open it
        self._wakeup = threading.Event()  # ends a wait
        self._stopping = self._seeking = False
        self._thread = threading.Thread(target=self._run, name="biotac-view-reader", daemon=True)
        self.start = self._thread.start
        #: Set before ``over`` when nothing can be played at all: the source is malformed or missing.
        self.failure: BaseException | None = None
        self.over = threading.Event()

    def stop(self) -> None:
        """Close the player, and wait for the thread to end."""
        self._stopping = True
        self._wakeup.set()
        if self._player is not None:
            self._close(self._player)
        self._thread.join()

    def ask(self, name: str, finger: int | None, value: float | str | None = None) -> str:
        """Carry out a command from a browser; return the result, in words.

        Raises InputError for an unknown command and when nothing plays; otherwise as the Player.
        """
        if name not in COMMANDS:
            raise InputError(f"unknown command {name!r}; expected one of {', '.join(COMMANDS)}")
        self._tried.wait(OPEN_S)
        with self._turn:
            if name == "seek":
                return self._seek(value)
            if name == "again":
                if self._player is not None:
                    raise InputError("it is already playing")
                self._wakeup.set()
                return "trying again"
            if self._player is None:
                raise InputError(self._why_waiting)
            words = self._player.do(name, finger, value)
            self._report_playing(self._player)
            return words

    def _seek(self, at_s: float | str | None) -> str:
        opener = self._opener
        if not isinstance(opener, RecordingOpener) or not isinstance(at_s, float):
            raise InputError("a board plays as time passes; open a recording to go to a time in it")
        opener.from_s = min(max(at_s, 0.0), (opener.recording.end_us - opener.recording.begin_us) / 1e6)
        self._seeking = True
        self._tried.clear()  # the next command is for the next player
        self._wakeup.set()
        if self._player is not None:
            self._player.close()
        return f"playing from {opener.from_s:.2f} s"

    # ---- the thread ----------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._stopping:
                self._once()
        except BaseException as error:
            self.failure = error
        finally:
            self._tried.set()
            self.over.set()

    def _once(self) -> None:
        try:
            player = self._opener()
        except InputError:
            raise  # waiting does not help with a malformed source
        except BiotacError as error:
            self._wait("lost", f"{self._loss}No board: {error}. Retrying every second.", RETRY_S)
            return
        self._loss, is_taken_over = "", False
        self._state.begin(player)
        with self._turn:
            self._player = player
            self._report_playing(player)
        self._tried.set()
        try:
            # Without a batch nothing is noticed: ``stop`` sets the flag, then closes the player, which ends them.
            for batch in player.batches() if not self._stopping else ():
                self._state.add(batch, player)
                if self._stopping or self._seeking:
                    break
        except (BiotacError, OSError) as error:
            # OSError: the disk is full while recording.
            kept = player.recording()
            self._loss = f"Connection lost: {error}. "
            if kept:
                self._loss += f"The recording {kept['path']} is kept up to that point. "
            is_taken_over = isinstance(error, StreamTakenError)
        self._close(player)
        if self._seeking:  # the player was closed for that
            self._seeking, self._loss = False, ""
        elif is_taken_over:  # to open the board again would take it back
            self._wait("taken", self._loss, None)
        elif self._loss:
            self._wait("lost", f"{self._loss}Retrying every second.", RETRY_S)
        elif not self._again:
            self._wait("over", "Playback finished.", None)

    def _report_playing(self, player: Player) -> None:
        if player.live:
            self._state.report("live", "Connected.")
        elif player.paused:
            self._state.report("paused", "Paused.")
        else:
            self._state.report("playing", "Playing a recording.")

    def _wait(self, link: str, words: str, seconds: float | None) -> None:
        """Wait, while every command but ``again`` is refused."""
        with self._turn:
            self._player, self._why_waiting = None, words
            if not self._seeking:
                self._wakeup.clear()
        self._tried.set()
        if not self._stopping:
            self._state.report(link, words)
            self._wakeup.wait(seconds)

    def _close(self, player: Player) -> None:
        try:
            player.close()
        except OSError as error:
            self._state.report("lost", f"{error}")
