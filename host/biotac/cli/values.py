"""Arguments that several verbs share, and their types."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from ..errors import InputError

if TYPE_CHECKING:
    from ..hand.hand import Hand


def number(text: str) -> float:
    """The number in ``text``; NaN, which is in no range, if there is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def facts(given: list[str]) -> dict[str, str]:
    """Facts of a label. Raises InputError for text without a fact, and for names that mean something else there."""
    made = {name: value for name, _, value in (fact.partition("=") for fact in given)}
    for name, value in made.items():
        if not value or name in ("", "path", "overwrite", "note", "self", "text", "at_s", "until_s", "finger"):
            raise InputError(f"--fact {name}={value}: expected NAME=VALUE, such as subject=S07")
    return made


def checked(good: Callable[[float], bool], problem: str) -> Callable[[str], float]:
    """The type of a number that is ``good``; ``problem`` ends the message about one that is not."""

    def parse(text: str) -> float:
        value = number(text)
        if not good(value):
            raise argparse.ArgumentTypeError(f"{text!r} is not {problem}")
        return value

    return parse


seconds = checked(lambda s: 0 < s < math.inf, "a time; expected seconds above 0")
#: Seconds since the first row.
moment = checked(lambda s: 0 <= s < math.inf, "a time; expected seconds, 0 or more")
#: Lines per second: 0 for all, or at least one a day.
rate = checked(
    lambda hz: hz == 0 or 1 / 86400 <= hz < math.inf,
    "a rate; expected lines per second, at least 1/86400, or 0 for all",
)


def pace(text: str) -> float:
    """``real``, ``fast``, or device seconds per second."""
    from ..link.port_text import parse_pace

    try:
        return parse_pace(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def count(most: int) -> Callable[[str], int]:
    """The type of a whole number from 1 to ``most``."""

    def parse(text: str) -> int:
        if not (text.isascii() and text.isdigit() and 1 <= int(text[:9]) <= most):
            raise argparse.ArgumentTypeError(f"seen {text!r}; expected a whole number, 1 to {most}")
        return int(text[:9])

    return parse


def finger(text: str) -> int:
    """A chip select, by number or by name."""
    from ..hand.views import DEFAULT_NAMES, finger_index

    try:
        return finger_index(DEFAULT_NAMES, int(text) if text.isdigit() else text)
    except KeyError as error:
        raise argparse.ArgumentTypeError(error.args[0]) from None


def fingers(text: str) -> tuple[int, ...]:
    return tuple(finger(part) for part in text.split(","))


def add_subverb(
    verbs: Any, name: str, run: Callable[[argparse.Namespace], int], text: str, example: str = ""
) -> argparse.ArgumentParser:
    """Add ``name`` to ``verbs``, the subparsers of a verb."""
    parser: argparse.ArgumentParser = verbs.add_parser(
        name,
        help=text,
        description=text,
        epilog=example and f"example: {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    # The verb has --json already; here it is for those who write it last.
    parser.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help="print JSON for machines")
    parser.set_defaults(run=run)
    return parser


def add_finger(parser: argparse.ArgumentParser, *, required: bool = True, text: str = "name or chip select") -> None:
    """Add --finger; it has no default, because nobody would notice a wrong one."""
    parser.add_argument("--finger", metavar="NAME", type=finger, required=required, help=text)


def check_answers(hand: Hand, finger: int) -> None:
    """Raises InputError if the finger does not answer."""
    if finger not in hand.fingers:
        raise InputError(f"finger {finger} does not answer: expected one of {hand.fingers}; check its cable")


def add_save(parser: argparse._ActionsContainer) -> None:
    text = "save it on the board, with all current settings, so that it survives a restart"
    parser.add_argument("--save", action="store_true", help=text)


def how_long(args: argparse.Namespace) -> str:
    """How long the board stores the new values, by --save."""
    return "saved" if args.save else "until the next reboot (--save keeps it)"


def add_port(parser: argparse.ArgumentParser, more: str = " (default: the only board on USB)") -> None:
    """Add PORT, which is optional if ``more``, the end of the help, names the default."""
    parser.add_argument(
        "port",
        metavar="PORT",
        nargs="?" if more else None,
        help="device path, serial:NUMBER, spidev:BUS.DEVICE, sim:SOURCE, emu:pico?source=SOURCE, replay:REC, "
        f"bag:FILE, csv:FILE or foxglove://HOST:PORT/TOPIC{more}",
    )


def add_take_link(parser: argparse.ArgumentParser) -> None:
    text = "take the board over from the host at the other port: that host's stream ends, its holds stay"
    parser.add_argument("--take-link", action="store_true", help=text)


def numbers(text: str) -> tuple[float, ...]:
    """Several finite numbers, separated by commas; empty for an empty text."""
    found = tuple(number(part) for part in text.split(",")) if text else ()
    if not all(map(math.isfinite, found)):
        raise argparse.ArgumentTypeError(f"seen {text!r}; expected numbers, separated by commas")
    return found


def refuse(args: argparse.Namespace, options: Iterable[str], why: str) -> None:
    """Raises InputError if one of these options is given: each has the default None, False or []."""
    for option in options:
        value = getattr(args, option)
        if value is not None and value is not False and value != []:
            raise InputError(f"--{option.replace('_', '-')} {why}")
