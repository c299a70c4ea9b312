"""biotac flash [PORT] [IMAGE]"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from ...errors import InputError, PortError
from ...flash import Backup, Image, Loader, Outcome, Restored, Target, flash, read_backup, read_image
from ...flash.image import note_text
from ...wire.identity import serial_text, version_text
from ..progress import Progress

EXAMPLE = "biotac flash /dev/ttyACM0 build/pico/biotac-pico.uf2"
IMAGE = Path("build/pico/biotac-pico.uf2")
EMULATED = "emu:pico?source=press.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Port, image, and what happens to the settings."""
    parser.add_argument(
        "port",
        metavar="PORT",
        nargs="?",
        help="device path or emu:pico?source=SOURCE (default: the only board there is)",
    )
    parser.add_argument(
        "image", metavar="IMAGE", nargs="?", help=f".uf2 file (default: {IMAGE} of the clone you are in)"
    )
    parser.add_argument("--emulated", action="store_true", help=f"rehearse it on an emulated board: {EMULATED}")
    parser.add_argument(
        "--backup", type=Path, metavar="FILE", help="new file for the settings (default: one in this folder)"
    )
    parser.add_argument("--no-backup", action="store_true", help="flash even a board whose firmware does not answer")
    parser.add_argument("--downgrade", action="store_true", help="flash an image older than the firmware that runs")
    parser.add_argument(
        "--restore", type=Path, metavar="FILE", help="settings from this backup in place of the board's own"
    )


def run(args: argparse.Namespace) -> int:
    """Flash, and say what the board says afterwards."""
    if args.backup is not None and args.no_backup:
        raise InputError("--backup and --no-backup contradict each other; leave one out")
    port, path = sort_out(args.port, args.image, emulated=args.emulated)
    image = read_image(path or find_image())
    kept = None if args.restore is None else read_backup(args.restore)
    say(f"{image.path}: {note_text(image.note)}")
    progress = Progress()
    target, loaders = find_board(port)
    try:
        outcome = flash(
            image,
            target,
            loaders,
            backup_path=args.backup,
            keep=not args.no_backup,
            restore_from=kept,
            downgrade=args.downgrade,
            say=say,
            show=lambda done, of: progress.show(f"{done} of {of} blocks"),
        )
    finally:
        progress.done()
        target.close()
    print(json.dumps(facts(image, outcome)) if args.json else summary(outcome))
    return 0


def say(text: str) -> None:
    """A step, on stderr: stdout is for what came of it."""
    print(text, file=sys.stderr, flush=True)


def sort_out(port: str | None, image: str | None, *, emulated: bool) -> tuple[str | None, Path | None]:
    """Both words are optional: a single one is the image when it ends in .uf2, or can be nothing else."""
    if image is None and port is not None and (emulated or port.lower().endswith(".uf2")):
        port, image = None, port
    if emulated and port is not None:
        raise InputError(f"--emulated stands for {EMULATED}, and {port} is another PORT; leave one out")
    return EMULATED if emulated else port, None if image is None else Path(image)


def find_image() -> Path:
    """The image that was built in the clone around the working directory."""
    for folder in (Path.cwd(), *Path.cwd().parents):
        if (folder / IMAGE).is_file():
            return folder / IMAGE
    raise InputError(f"no {IMAGE} here or above; name the IMAGE, a .uf2 file (building one: firmware/boards/pico)")


def find_board(port: str | None) -> tuple[Target, list[Loader]]:
    """The board, and the ways to its loader."""
    if port is not None and port.startswith(("emu:", "sim:")):
        from ...flash.loader_emulated import EmulatedLoader
        from ...flash.target_emulated import EmulatedTarget

        emulated = EmulatedTarget(port)
        return emulated, [EmulatedLoader(emulated.board)]
    from ...flash.loader_drive import DriveLoader
    from ...flash.loader_picotool import PicotoolLoader
    from ...flash.target_serial import SerialTarget, only_port

    loaders: list[Loader] = [DriveLoader(), PicotoolLoader()]
    port = port or only_port()
    if port is None and not any(loader.ready() for loader in loaders):
        cures = "; ".join(loader.cure() for loader in loaders)
        raise PortError(f"no board is there, neither running nor in its loader: {cures}; or name its PORT")
    return SerialTarget(port), loaders


def facts(image: Image, outcome: Outcome) -> dict[str, Any]:
    """For machines."""
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


def known(backup: Backup, settings: Restored) -> str:
    """How many of a backup's settings, calibrations and maps the firmware has."""
    more = {"calibrations": len(backup.calibrations), "wrench maps": len(backup.maps)}
    count = len(backup.values) + sum(more.values()) - len(settings.unknown)
    return f"{count} {', '.join(['settings', *(name for name, its in more.items() if its)])}"


def summary(outcome: Outcome) -> str:
    """For people."""
    after, settings = outcome.after, outcome.settings
    lines = [
        f"{outcome.port} runs firmware {version_text(after)}, boot {after.boot_id:08x}, serial {serial_text(after)}"
    ]
    if settings is None or outcome.backup is None:
        lines.append("its settings are those in its flash; none were read before, none were restored")
    else:
        changed = ", ".join(settings.changed)
        lines.append(f"all {known(outcome.backup, settings)} are as in {outcome.backup.path}")
        lines[-1] += f"; restored and saved: {changed}" if changed else ", none had to be restored"
        if settings.unknown:
            lines.append(f"this firmware does not know {', '.join(settings.unknown)}; see {outcome.backup.path}")
    return "\n".join(lines)
