"""The exceptions that this package raises on purpose, ordered by where the fault is.

Each message is one line: the value seen, the one expected, and the cure. The command line maps
``exit_code`` to its exit status; the codes are fixed (see ``biotac --help``).
"""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import ModuleType

LONGEST = 1000  # characters of a message


class BiotacError(Exception):
    """Base of all errors of this package."""

    exit_code = 70

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(message))


class InputError(BiotacError):
    """A file or an argument cannot be used."""

    exit_code = 2


def error_text(error: Exception) -> str:
    """The text of an error, or the type where it has none; a KeyError would quote the text."""
    return str(error.args[0]) if isinstance(error, KeyError) and error.args else str(error) or type(error).__name__


def exists_error(path: object) -> InputError:
    """The error for a ``path`` that exists and may not be overwritten."""
    return InputError(f"{path} already exists; choose another name, or overwrite it (--force, overwrite=True)")


def path_text(path: Path) -> str:
    """A path as a person would type it: relative where it is in the present folder."""
    with suppress(ValueError, OSError):
        path = path.relative_to(Path.cwd())
    return str(path)


def installing(extra: str) -> str:
    """The command that installs what the ``extra`` needs."""
    return f"pip install 'biotac-gateway[{extra}]', in a clone pip install '.[{extra}]'"


def imported(module: str, purpose: str, extra: str) -> ModuleType:
    """A module that needs the ``extra``, for ``purpose``. Raises InputError where a package of it is missing."""
    try:
        return import_module(module)
    except (ImportError, AttributeError) as error:
        cure = installing(extra)
        if not isinstance(error, ModuleNotFoundError):  # a name is missing in it, or a library that it loads
            broken = f"cannot use what is installed ({error}): too old, or not whole"
            raise InputError(f"{purpose} {broken}; {cure.replace(' install', ' install --upgrade')}") from error
        raise InputError(f"{purpose} needs {error.name}, which is not installed; {cure}") from error


class ScenarioError(InputError):
    """A scenario file is malformed; the message names file, line and key."""


class RecordingError(InputError):
    """A recording cannot be read."""


class RecordingWarning(UserWarning):
    """Part of a recording is missing or damaged; the rest was read."""


class ReadWarning(UserWarning):
    """``Hand.read`` returned less than was asked for: there is a Gap."""


class PortError(BiotacError):
    """The port does not exist, is busy or cannot be opened."""

    exit_code = 3


class PortBusyError(PortError):
    """Another program has the port open."""


class NotAGatewayError(BiotacError):
    """Something is on the port, but it does not speak this protocol."""

    exit_code = 4


class WireVersionError(BiotacError):
    """The firmware speaks another major version of the protocol."""

    exit_code = 5


class DeviceLostError(BiotacError):
    """The board went away or fell silent while in use."""

    exit_code = 6


class StreamTakenError(DeviceLostError):
    """Another program, or the board's other port, took over the stream, which is not taken back."""


class CommandRefusedError(BiotacError):
    """The board answered a command with an error code, ``error``."""

    exit_code = 7

    def __init__(self, message: str, error: int = 0) -> None:
        super().__init__(message)
        self.error = error


class CallbackError(BiotacError):
    """A function given to ``Hand.on_...`` raised; the function's error is the cause."""


class FlashError(BiotacError):
    """Writing an image to a board failed; the message names the backup of the settings, if there is one."""

    exit_code = 8


def printable(text: str) -> str:
    """``text`` as one line of bounded length: it may quote a damaged file, or contain terminal escape sequences."""
    if len(text) > LONGEST:
        text = f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
