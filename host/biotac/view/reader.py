"""The only reading thread: opens the source, plays it, carries out commands, and reopens what went away."""

from __future__ import annotations

import queue
import threading
from concurrent.futures import Future
from dataclasses import dataclass, field

from ..errors import BiotacError, InputError
from .player import COMMANDS, Opener, Player
from .state import State

RETRY_S = 1.0
ANSWER_S = 10.0


@dataclass
class Command:
    """A command from a browser; ``done`` gets a description of what was done, or the error."""

    name: str
    finger: int | None
    done: Future[str] = field(default_factory=Future)


class Reader:
    """Plays what ``opener`` opens into ``state``. ``again``: start over after the end."""

    def __init__(self, opener: Opener, state: State, *, again: bool) -> None:
        self._opener = opener
        self._state = state
        self._again = again
        self._loss = ""  # how the board was lost, while it is lost
        self._commands: queue.Queue[Command | None] = queue.Queue()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="biotac-view-reader", daemon=True)
        #: Set before ``over`` when nothing can be played at all: the source is malformed or missing.
        self.failure: BaseException | None = None
        self.over = threading.Event()

    def start(self) -> None:
        """Start playing."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread and wait for it; it closes what is open."""
        self._stop.set()
        self._commands.put(None)
        self._thread.join()

    def ask(self, name: str, finger: int | None) -> str:
        """Have the thread carry out a command; return what was done, in words.

        Raises InputError for an unknown command, when nothing plays, and when the command was not done in time; if it
        was not even begun, it is cancelled. Otherwise raises what the Player raises.
        """
        if name not in COMMANDS:
            raise InputError(f"unknown command {name!r}; expected one of {', '.join(COMMANDS)}")
        command = Command(name, finger)
        self._commands.put(command)
        try:
            return command.done.result(timeout=ANSWER_S)
        except TimeoutError:
            if not command.done.cancel():
                raise InputError(
                    f"{name} has been running for over {ANSWER_S:.0f} s; check whether it took effect"
                ) from None
            raise InputError(f"{name} did not start within {ANSWER_S:.0f} s and was cancelled; try again") from None

    # ---- the thread ----------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                self._once()
        except BaseException as error:
            self.failure = error
        finally:
            self.over.set()

    def _once(self) -> None:
        try:
            player = self._opener()
        except InputError:
            raise  # waiting does not help with a malformed source
        except BiotacError as error:
            self._rest("lost", f"{self._loss}No board: {error}. Retrying every second.", RETRY_S)
            return
        self._loss = ""
        try:
            self._state.begin(player)
            ended = self._play(player)
        except (BiotacError, OSError) as error:
            # OSError: the disk is full while recording.
            kept = player.recording()
            self._close(player)
            self._loss = f"Connection lost: {error}. "
            if kept:
                self._loss += f"The recording {kept.path} is kept up to that point. "
            self._rest("lost", f"{self._loss}Retrying every second.", RETRY_S)
            return
        self._close(player)
        if ended and not self._again:
            self._rest("over", "Playback finished.", None)

    def _play(self, player: Player) -> bool:
        self._say_playing(player)
        for batch in player.batches():
            self._state.take(batch, player)
            while not self._commands.empty():
                command = self._commands.get()
                if command is not None and command.done.set_running_or_notify_cancel():
                    self._obey(player, command)
            if self._stop.is_set():
                return False
        return True

    def _say_playing(self, player: Player) -> None:
        if player.live:
            self._state.say("live", "Connected.")
        elif player.paused:
            self._state.say("paused", "Paused.")
        else:
            self._state.say("playing", "Playing a recording.")

    def _obey(self, player: Player, command: Command) -> None:
        try:
            if command.name == "again":
                raise InputError("it is already playing")
            words = player.do(command.name, command.finger)
        except (BiotacError, OSError) as error:
            command.done.set_exception(error)
        else:
            command.done.set_result(words)
            self._say_playing(player)

    def _rest(self, link: str, words: str, seconds: float | None) -> None:
        """Wait, refusing every command but ``again``."""
        self._state.say(link, words)
        while not self._stop.is_set():
            try:
                command = self._commands.get(timeout=seconds)
            except queue.Empty:
                return
            if command is None or not command.done.set_running_or_notify_cancel():
                continue
            if command.name == "again":
                command.done.set_result("playing again" if link == "over" else "looking again")
                return
            command.done.set_exception(InputError(words))

    def _close(self, player: Player) -> None:
        try:
            player.close()
        except OSError as error:
            self._state.say("lost", f"{error}")
