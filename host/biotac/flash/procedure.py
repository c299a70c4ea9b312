"""Flashing from end to end: the settings are saved to a file first, and only the board's HELLO counts as success."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import BiotacError, FlashError, InputError, NotAGatewayError, WireVersionError
from ..wire import messages_gen as wire
from ..wire.identity import board_name, board_text, serial_text, version_text
from .backup import Backup, Restored, restore, save
from .families import RP2040, Family
from .image import CHIP_OF, Image, note_text
from .interfaces import Loader, Target
from .interfaces import Show as ShowBlocks
from .waiting import wait_for

LOADER_S = 20.0  # from the command to a mounted drive; desktops take some seconds
Log = Callable[[str], None]


@dataclass(frozen=True)
class Outcome:
    """Result of flashing a board.

    ``before`` is None when no firmware answered before; ``backup`` is the restored one, None without.
    """

    port: str
    loader: str
    before: wire.Hello | None
    after: wire.Hello
    backup: Backup | None
    settings: Restored | None


def flash(
    image: Image,
    target: Target,
    loaders: Sequence[Loader],
    *,
    backup_path: Path | None = None,
    keep: bool = True,
    restore_from: Backup | None = None,
    downgrade: bool = False,
    take_link: bool = False,
    log: Log = lambda text: None,
    show: ShowBlocks = lambda done, total: None,
) -> Outcome:
    """Write ``image`` to the board and restore the settings.

    The settings are first saved to ``backup_path`` (default: a new file in the working directory). Without ``keep``
    they are not saved, and a board with firmware that does not answer is flashed too. ``restore_from`` replaces the
    settings just saved; a board already in its loader cannot be asked for settings and gets only these. An image older
    than the board's firmware is refused without ``downgrade``. ``take_link`` ends the streams and holds of the host at
    the board's other port; without it, that host makes the board refuse.

    Raises InputError, before the board is changed, for an image that does not fit it, and FlashError for anything that
    fails later.
    """
    if image.note.wire[0] != wire.WIRE_MAJOR:
        raise InputError(
            f"{image.path} speaks wire {image.note.wire[0]}, this library {wire.WIRE_MAJOR}: it could not verify "
            "the result; install the biotac-gateway of the image's release"
        )
    if restore_from is not None and image.note.board == wire.BoardKind.PICO_SENSOR:
        raise InputError(f"{image.path} is for a sensor board, which keeps no settings; drop --restore")
    loader = first_ready(loaders)
    before: wire.Hello | None = None
    written: Backup | None = None
    if loader is None:
        before, written = enter_loader(
            image, target, backup_path=backup_path, keep=keep, downgrade=downgrade, take_link=take_link, log=log
        )
    elif target.port_exists():
        raise InputError(
            f"{target.port} is plugged in, and another board is in its loader ({loader.name}); unplug one of them"
        )
    backup = restore_from or written
    with step(written or restore_from):
        if loader is None:
            loader = wait_for(lambda: first_ready(loaders), LOADER_S)
            if loader is None:
                cures = "; ".join(own.cure() for own in loaders)
                raise FlashError(f"no board in its loader was found within {LOADER_S:.0f} s: {cures}; then flash again")
        log(f"writing {len(image.blocks)} blocks to the {loader.name}")
        loader.write(image, show)
        log("waiting for the board to come back")
        with target.reopen() as hand:
            if take_link:  # the other host may have begun again
                hand.take_link()
            check(image, before, hand.info)
            settings = None if backup is None else restore(hand, backup)
            return Outcome(target.port, loader.name, before, hand.info, backup, settings)


def family_of(target: Target, loaders: Sequence[Loader]) -> Family:
    """The chip of the board in the loader, or of the one that answers; an RP2040 where neither is known."""
    loader = first_ready(loaders)
    if loader is not None:
        return loader.family() or RP2040
    try:
        with target.open() as hand:
            return CHIP_OF.get(hand.info.board, RP2040)
    except BiotacError:
        return RP2040  # flash names the fault


def first_ready(loaders: Sequence[Loader]) -> Loader | None:
    return next((loader for loader in loaders if loader.ready()), None)


def enter_loader(
    image: Image, target: Target, *, backup_path: Path | None, keep: bool, downgrade: bool, take_link: bool, log: Log
) -> tuple[wire.Hello | None, Backup | None]:
    """Identify the board, save the settings, and send it to its loader; return the HELLO and the backup."""
    try:
        hand = target.open()
    except (NotAGatewayError, WireVersionError) as error:
        if keep:
            raise type(error)(f"{error}, or flash it without a backup of its settings: --no-backup") from error
        log(f"{error}; trying the 1200 baud touch")
        target.touch()
        return None, None
    with hand:
        if hand.info.board != image.note.board:
            raise InputError(
                f"{image.path} is for {board_text(image.note.board)}, but {board_name(hand.info)} answers on "
                f"{target.port}; use that board's image"
            )
        if not downgrade and image.note.firmware < firmware(hand.info):
            raise InputError(
                f"{image.path} has firmware {image.note.version}, {target.port} runs {version_text(hand.info)}: older "
                "firmware may not understand newer settings; use --downgrade if you mean it"
            )
        log(f"{target.port} runs firmware {version_text(hand.info)}, serial {serial_text(hand.info)}")
        if take_link:
            hand.take_link()
        # A sensor board has no settings to save.
        backup = save(hand, backup_path) if keep and hand.info.board != wire.BoardKind.PICO_SENSOR else None
        if backup is not None:
            log(f"saved {len(backup.values)} settings to {backup.path}")
        with step(backup):
            hand.board.reboot_bootloader()
        return hand.info, backup


def firmware(hello: wire.Hello) -> tuple[int, int, int]:
    return hello.firmware_major, hello.firmware_minor, hello.firmware_patch


def check(image: Image, before: wire.Hello | None, after: wire.Hello) -> None:
    """Raise FlashError unless the board's HELLO proves that it runs ``image`` and has restarted."""
    if before is not None and after.board_serial != before.board_serial:
        raise FlashError(
            f"serial {serial_text(after)} came back, not {serial_text(before)}; leave only one board plugged in"
        )
    if (after.board, firmware(after)) != (image.note.board, image.note.firmware):
        raise FlashError(
            f"the board that came back is {board_name(after)}, firmware {version_text(after)}; expected "
            f"{note_text(image.note)}: the image is not running; flash again"
        )
    if after.image_crc32 != image.note.crc32:
        raise FlashError(
            f"the board's flash has CRC-32 {after.image_crc32:08x}, the image {image.note.crc32:08x}: it was not "
            "written completely; flash again"
        )
    if before is not None and after.boot_id == before.boot_id:
        raise FlashError(f"the board still has boot id {after.boot_id:08x}: it has not restarted; plug it in again")


@contextmanager
def step(backup: Backup | None) -> Iterator[None]:
    """Turn any BiotacError into a FlashError that also says where the settings are."""
    try:
        yield
    except BiotacError as error:
        where = "" if backup is None else f"; the settings are saved in {backup.path}: restore them with --restore"
        raise FlashError(f"{error}{where}") from error


@dataclass(frozen=True)
class Result:
    """Result for one board. ``outcome`` is None if it was not flashed: ``why``, or the ``error``."""

    port: str
    outcome: Outcome | None = None
    error: BiotacError | None = None
    why: str = ""


def flash_every(image: Image, targets: Iterable[Target], loaders: Sequence[Loader], **options: Any) -> Iterator[Result]:
    """Flash each of ``targets`` as ``flash`` does with these ``options``.

    A board that already runs this image, or that the image is not for, stays as it is.

    A failure is reported in a Result, and the next board follows. Boards are flashed one after the other, because a
    loader does not say which board it is.
    """
    for target in targets:
        try:
            why = why_skipped(image, target)
            yield Result(target.port, None if why else flash(image, target, loaders, **options), why=why)
        except BiotacError as error:
            yield Result(target.port, error=error)
        finally:
            target.close()


def why_skipped(image: Image, target: Target) -> str:
    """Why a board needs no flashing by its HELLO; empty if it does, or does not answer."""
    try:
        with target.open() as hand:
            if hand.info.board != image.note.board:
                return f"is a {board_name(hand.info)}, which {image.path.name} is not for"
            return "already runs this image" if hand.info.image_crc32 == image.note.crc32 else ""
    except BiotacError:
        return ""
