"""biotac flash [PORT] [IMAGE], biotac flash --all [IMAGE]"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

from ... import extra
from ...errors import FlashError, InputError, PortError
from ...flash import Image, Loader, Outcome, Target, flash, read_backup, read_image
from ...flash.image import find_image, note_text
from ...flash.procedure import family_of, flash_every
from ...wire.identity import serial_text, version_text
from .. import ending, outputs, values
from ..progress import Progress

EXAMPLE = "biotac flash /dev/ttyACM0"
STM32 = "an STM32 is written by stm32loader: firmware/boards/f405/README.md has its line"
EMULATED = "emu:pico?source=press.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "port",
        metavar="PORT",
        nargs="?",
        help="device path, or emu:pico?source=SOURCE (default: the only board on USB)",
    )
    parser.add_argument(
        "image",
        metavar="IMAGE",
        nargs="?",
        help="a .uf2 file (default: this package's, else the one built in this clone)",
    )
    parser.add_argument("--all", action="store_true", help="every connected board that runs another version")
    parser.add_argument("--emulated", action="store_true", help=f"rehearse it on an emulated board: {EMULATED}")
    parser.add_argument(
        "--backup", type=Path, metavar="FILE", help="new file for the settings (default: one in this folder)"
    )
    parser.add_argument("--no-backup", action="store_true", help="flash even a board whose firmware does not answer")
    values.add_take_link(parser)
    parser.add_argument("--downgrade", action="store_true", help="flash an image older than the running firmware")
    parser.add_argument(
        "--restore", type=Path, metavar="FILE", help="restore settings from this backup instead of the board's own"
    )


def run(args: argparse.Namespace) -> int:
    if args.backup is not None and args.no_backup:
        raise InputError("--backup and --no-backup contradict each other; use only one")
    port, path = sort_out(args.port, args.image, alone=args.emulated or args.all)
    if args.all:
        values.refuse(args, ("emulated", "backup", "restore"), "is for one board; use only one, it or --all")
    image = read_image(path or find_image())
    kept = None if args.restore is None else read_backup(args.restore)
    if args.all:
        return run_all(None if path is None else image, args)
    target, loaders = find_board(EMULATED if args.emulated else port)
    if path is None and not args.emulated:
        image = read_image(find_image(family_of(target, loaders)))
    outputs.step(f"{image.path}: {note_text(image.note)}")
    with closing(target), Progress() as progress, options(args, progress) as given:
        outcome = flash(image, target, loaders, backup_path=args.backup, restore_from=kept, **given)
    outputs.report(args, facts(image, outcome), summary(outcome))
    return 0


@contextmanager
def options(args: argparse.Namespace, progress: Progress) -> Iterator[dict[str, Any]]:
    """The options for any board. While blocks are written a signal ends it after one, and says how to go on."""
    with ExitStack() as writing:
        looks: list[Callable[[], None]] = []

        def show(done: int, total: int) -> None:
            progress.show(f"{done} of {total} blocks")
            if done < total and not looks:
                looks.append(writing.enter_context(ending.held()))
            for look in looks:
                look()
            if done >= total:
                looks.clear()
                writing.close()

        given = {"keep": not args.no_backup, "downgrade": args.downgrade, "take_link": args.take_link}
        try:
            yield given | {"log": outputs.step, "show": show}
        except KeyboardInterrupt:
            again = "run it again: a board whose image is not whole waits in its loader"
            if not args.no_backup:
                again += "; settings that were not saved are in the backup that was named (--restore)"
            raise KeyboardInterrupt(again) from None


def run_all(image: Image | None, args: argparse.Namespace) -> int:
    """Flash every board with the image or its chip's; print the result of each; return 8 if one of them failed."""
    from ...flash.target_serial import SerialTarget, gateway_ports

    targets = [SerialTarget(port) for port in sorted(gateway_ports())]
    if not targets:
        raise PortError("no board is plugged in; `biotac list` shows what is there")
    results, rows = [], []
    with Progress() as progress, options(args, progress) as given:
        loaders = usb_loaders()
        for target in targets:
            its = image or read_image(find_image(family_of(target, loaders)))
            (result,) = flash_every(its, [target], loaders, **given)
            progress.done()
            results.append(result)
            done = facts(its, result.outcome) if result.outcome else {"why": result.why}
            rows.append({"port": result.port, "error": result.error and str(result.error), **done})
            if result.error is not None:
                outputs.step(f"{result.port}: {result.error}")
            elif not args.json:
                print(summary(result.outcome) if result.outcome else f"{result.port} {result.why}")
    if args.json:
        print(json.dumps(rows))
    failed = [result.port for result in results if result.error is not None]
    if failed:
        raise FlashError(f"{len(failed)} of {len(results)} boards were not flashed: {', '.join(failed)}; see above")
    return 0


def sort_out(port: str | None, image: str | None, *, alone: bool) -> tuple[str | None, Path | None]:
    """PORT and IMAGE, both optional: a single word is the image by its ending, or if no PORT is allowed."""
    if image is None and port is not None and (alone or port.lower().endswith(".uf2")):
        port, image = None, port
    if alone and port is not None:
        raise InputError(f"--emulated and --all choose the board, but PORT {port} is given; drop one of them")
    return port, None if image is None else Path(image)


def find_board(port: str | None) -> tuple[Target, list[Loader]]:
    """The board, and the ways to reach its boot loader."""
    if port is not None and port.startswith(("emu:", "sim:")):
        target, loader = extra.rig(port, lambda rig: rig.flash_target(port))
        return target, [loader]
    if port is not None and port.startswith("uart:"):
        raise InputError(f"{port}: a board with no USB is not flashed from here; {STM32}")
    from ...flash.target_serial import SerialTarget, only_port

    loaders = usb_loaders()
    port = port or only_port()
    if port is None and not any(loader.ready() for loader in loaders):
        cures = "; ".join(loader.cure() for loader in loaders)
        raise PortError(f"no board found, running or in its loader: {cures}; or name its PORT")
    return SerialTarget(port), loaders


def usb_loaders() -> list[Loader]:
    from ...flash.loader_drive import DriveLoader
    from ...flash.loader_picotool import PicotoolLoader

    return [DriveLoader(), PicotoolLoader()]


def facts(image: Image, outcome: Outcome) -> dict[str, Any]:
    before, settings = outcome.before, outcome.settings
    return {
        "image": str(image.path),
        "port": outcome.port,
        "loader": outcome.loader,
        "serial_number": serial_text(outcome.after),
        "firmware_before": None if before is None else version_text(before),
        "firmware": version_text(outcome.after),
        "boot_id_before": None if before is None else before.boot_id,
        "boot_id": outcome.after.boot_id,
        "backup": None if outcome.backup is None else str(outcome.backup.path),
        "settings_restored": None if settings is None else list(settings.changed),
        "settings_unknown": None if settings is None else list(settings.unknown),
    }


def summary(outcome: Outcome) -> str:
    after, settings = outcome.after, outcome.settings
    lines = [
        f"{outcome.port} runs firmware {version_text(after)}, boot {after.boot_id:08x}, serial {serial_text(after)}"
    ]
    if settings is None or outcome.backup is None:
        lines.append("no settings were backed up or restored; the board uses those in its flash")
    else:
        changed, backup = ", ".join(settings.changed), outcome.backup
        more = {"calibrations": len(backup.calibrations), "wrench maps": len(backup.maps)}
        kinds = ", ".join(["settings", *(name for name, held in more.items() if held)])
        count = len(backup.values) + sum(more.values()) - len(settings.unknown)
        lines.append(f"all {count} {kinds} match {backup.path}")
        lines[-1] += f"; restored and saved: {changed}" if changed else ", nothing had to be restored"
        if settings.unknown:
            lines.append(f"this firmware does not know {', '.join(settings.unknown)}; see {backup.path}")
    return "\n".join(lines)
