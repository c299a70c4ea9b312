"""Flashing a board from one build to another, and the board after power cuts in the middle. Emulated.

The loader is this project's model of the boot ROM's (tools/emulator/loader.mjs); silicon has not been tried.
"""

import json
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fake_flash_board import uf2
from maps import BIG, make_map
from stand_in import StandIn

from biotac import Calibration, Hand, Setting
from biotac.cli.main import main
from biotac.errors import FlashError, InputError, NotAGatewayError
from biotac.flash import Image, Outcome, flash, read_backup, read_image
from biotac.flash.note import seal
from biotac.wire import messages_gen as wire
from biotac_rig.flashing import EmulatedLoader, EmulatedTarget
from rig import ROOT, Rig

PAGE = 256
SECTOR = 4096
WORLD = "name = 'rest'\nseed = 1\nfingers = 1\n[[step]]\ndo = 'rest'\nseconds = 600\n"


class Bench:
    """An emulated board that runs the built image, the way to the loader, and a folder for backups."""

    def __init__(self, rig: Rig, folder: Path) -> None:
        source = folder / "rest.toml"
        source.write_text(WORLD)
        self.folder = folder
        self.port = rig.facts["port"].format(source=source, options="pace=fast&seconds=300")
        self.target = EmulatedTarget(self.port)
        self.loader = EmulatedLoader(self.target.board)
        self.flashed = 0
        self.built = rig.image

    def flash(self, image: Image, **options: Any) -> Outcome:
        self.flashed += 1
        path = self.folder / f"backup{self.flashed}.json"
        return flash(image, self.target, [self.loader], backup_path=path, **options)

    def counters(self) -> dict[str, Any]:
        return self.target.board.counters()

    def set(self, setting: Setting, value: int, *, save: bool) -> None:
        with self.target.open() as hand:
            hand.board.set_setting(setting, value)
            if save:
                hand.board.save_settings()

    def setting_after_a_power_cut(self, setting: Setting) -> int:
        boots = self.counters()["boots"]
        self.target.board.send_line("cut power")
        self.target.board.until(5, boots=boots + 1, usb={"state": "configured"})
        with self.target.open() as hand:
            return hand.board.setting(setting)


@pytest.fixture
def bench(rig: Rig, tmp_path: Path) -> Iterator[Bench]:
    rig.need("flashing")
    made = Bench(rig, tmp_path)
    yield made
    wrong = made.counters()["flash"]["wrong"]
    made.target.close()
    assert wrong == []


_built: dict[Path, Image] = {}


@pytest.fixture
def next_release(bench: Bench, tmp_path_factory: pytest.TempPathFactory) -> Image:
    """The same sources with another patch number, built as the image is: once, and only where there is a bench."""
    if bench.built not in _built:
        _built[bench.built] = build_next_release(tmp_path_factory.mktemp("next"), bench.built)
    return _built[bench.built]


def build_next_release(folder: Path, built: Path) -> Image:
    shutil.copytree(ROOT / "firmware", folder / "firmware")
    (folder / "tools").symlink_to(ROOT / "tools")
    version = folder / "firmware/app/version.h"
    patch = (read_image(built).note.firmware[2] + 1) % 10
    text, changes = re.subn(r"(BT_VERSION_PATCH) \d+", rf"\g<1> {patch}", version.read_text())
    assert changes == 1
    version.write_text(text)
    build = folder / "build"
    configure = ["cmake", "-S", str(folder / "firmware/boards" / built.parent.name), "-B", str(build), "-G", "Ninja"]
    for command in (configure, ["cmake", "--build", str(build)]):
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    return read_image(build / built.name)


def test_a_board_comes_back_with_its_settings(bench: Bench) -> None:
    bench.set(Setting.IDLE_PERIOD_MS, 250, save=True)
    bench.set(Setting.FORCE_GAIN_X_NN, -7, save=False)  # in force, and lost with the reboot
    before = bench.counters()
    outcome = bench.flash(read_image(bench.built))
    assert outcome.before is not None
    assert outcome.before.boot_id != outcome.after.boot_id
    assert outcome.before.board_serial == outcome.after.board_serial
    assert outcome.settings is not None
    assert outcome.settings.changed == ("force_gain_x_nn",)
    assert bench.setting_after_a_power_cut(Setting.IDLE_PERIOD_MS) == 250
    assert bench.setting_after_a_power_cut(Setting.FORCE_GAIN_X_NN) == -7
    after = bench.counters()
    assert after["loaders"] == before["loaders"] + 1
    blocks = len(read_image(bench.built).blocks)
    assert after["flash"]["programs"] - before["flash"]["programs"] == blocks + 1  # and one record of settings
    assert after["flash"]["erases"] - before["flash"]["erases"] == -(-blocks * PAGE // SECTOR)


def test_saved_maps_outlive_another_image(bench: Bench, next_release: Image) -> None:
    blob = make_map(1, blocks=BIG)
    with bench.target.open() as hand:
        for _ in range(3):  # so that it lies somewhere else than in the first slot
            hand.board.set_map(0, blob)
        hand.board.save_settings()
    bench.flash(next_release)
    with bench.target.open() as hand:
        assert hand.board.maps() == {0: blob}


def give_map(hand: Hand, finger: int, blob: bytes) -> None:
    hand.board.set_map(finger, blob, force=finger == 1)


@pytest.mark.parametrize(
    ("give", "name", "what", "kept", "new"),
    [
        (give_map, "wrench map", "maps", make_map(1), make_map(2, blocks=BIG)),
        (
            lambda hand, finger, own: hand.board.set_calibration(finger, own),
            "calibration",
            "calibrations",
            Calibration(thermal_gain_milli=700),
            Calibration(force_gain_nn=(1, 2, -3), made_s=1_700_000_000),
        ),
    ],
)
def test_what_was_in_force_and_not_saved_is_put_back_and_saved(
    bench: Bench, give: Callable[[Hand, int, Any], None], name: str, what: str, kept: object, new: object
) -> None:
    with bench.target.open() as hand:
        give(hand, 0, kept)
        give(hand, 1, kept)
        hand.board.save_settings()
        give(hand, 0, new)
    outcome = bench.flash(read_image(bench.built))
    assert outcome.settings is not None and outcome.backup is not None
    assert outcome.settings.changed == (f"{name} of finger 0",)
    assert getattr(read_backup(outcome.backup.path), what) == {0: new, 1: kept}
    bench.setting_after_a_power_cut(Setting.IDLE_PERIOD_MS)
    with bench.target.open() as hand:
        assert getattr(hand.board, what)() == {0: new, 1: kept}


def test_another_release_is_what_hello_says_afterwards(bench: Bench, next_release: Image) -> None:
    bench.set(Setting.IDLE_PERIOD_MS, 250, save=True)
    outcome = bench.flash(next_release)
    assert outcome.before is not None
    assert outcome.after.firmware_patch == next_release.note.firmware[2] != outcome.before.firmware_patch
    assert outcome.settings is not None
    assert outcome.settings.changed == ()
    with pytest.raises(InputError, match=r"runs .*; use --downgrade if you mean it"):
        bench.flash(read_image(bench.built))
    back = bench.flash(read_image(bench.built), downgrade=True)
    assert back.after.firmware_patch == outcome.before.firmware_patch
    assert bench.setting_after_a_power_cut(Setting.IDLE_PERIOD_MS) == 250


def changed(bench: Bench, at: int, value: int, *, sealed: bool = False) -> Path:
    """The built image with one byte of the flash changed; sealed: and a note that knows of it."""
    flash = bytearray(bench.built.with_suffix(".bin").read_bytes())
    assert flash[at] != value
    flash[at] = value
    path = bench.folder / "changed.uf2"
    path.write_bytes(
        uf2.uf2(seal(bytes(flash)) if sealed else bytes(flash), read_image(bench.built).family.chip.lower())
    )
    return path


def test_a_wrong_image_leaves_the_board_alone(bench: Bench) -> None:
    before = bench.counters()
    with bench.target.open() as hand:
        boot_id = hand.info.boot_id
    with pytest.raises(InputError, match="CRC-32"):
        read_image(changed(bench, 5000, 0xEE))
    board_at = bench.built.with_suffix(".bin").read_bytes().index(b"BIOTAC image") + 14
    other = read_image(changed(bench, board_at, wire.BoardKind.LINUX_SBC, sealed=True))
    with pytest.raises(InputError, match=r"is for LINUX_SBC, but Pico.* answers"):
        bench.flash(other)
    with bench.target.open() as hand:
        assert hand.info.boot_id == boot_id
    after = bench.counters()
    assert [after[name] for name in ("boots", "loaders")] == [before[name] for name in ("boots", "loaders")]
    assert after["flash"] == before["flash"]


CUTS = [1, 2000, SECTOR + 100, SECTOR + 15 * PAGE + 7, 40_000, -PAGE + 8, -1]


@pytest.mark.parametrize("cut", CUTS)
def test_after_a_power_cut_it_is_flashed_from_the_loader(bench: Bench, tmp_path: Path, cut: int) -> None:
    """The boot block goes last: a cut at any byte, first to last, leaves a board in the loader."""
    image = read_image(bench.built)
    if cut == 1 and image.family.chip == "RP2350":
        cut = PAGE  # the ROM looks at IMAGE_DEF alone, at that page's end, and sees no erase that stopped before it
    blocks = len(image.blocks)
    total = -(-blocks * PAGE // SECTOR) * SECTOR + blocks * PAGE
    bench.set(Setting.IDLE_PERIOD_MS, 250, save=True)
    bench.target.board.do(f"cut power after {cut if cut >= 0 else total + cut} flash bytes")
    with pytest.raises(FlashError, match=r"emulated board came to .*backup1.json: restore them with --restore"):
        bench.flash(image)
    facts = bench.counters()
    assert facts["loader"] == {"blocks": 0, "of": 0, "waiting": 0, "ignored": 0}
    assert facts["usb"]["state"] == "detached"
    outcome = bench.flash(image)
    assert outcome.before is None
    with bench.target.open() as hand:
        assert hand.board.setting(Setting.IDLE_PERIOD_MS) == 250


def test_a_power_cut_before_the_first_byte_leaves_the_old_firmware(bench: Bench, next_release: Image) -> None:
    bench.target.board.do("cut power after 0 flash bytes")
    with pytest.raises(FlashError, match="the settings are saved in"):
        bench.flash(next_release)
    outcome = bench.flash(next_release)
    assert outcome.before is not None
    assert outcome.before.firmware_patch == read_image(bench.built).note.firmware[2]
    assert outcome.after.firmware_patch == next_release.note.firmware[2]


def test_firmware_that_does_not_answer_is_left_by_touch(bench: Bench) -> None:
    def mute() -> None:
        raise NotAGatewayError("nothing answers")

    opening = bench.target.open
    bench.target = StandIn(bench.target, open=mute, reopen=lambda: (came_back(bench), opening())[1])
    outcome = bench.flash(read_image(bench.built), keep=False)
    assert (outcome.before, outcome.backup) == (None, None)
    assert bench.counters()["loaders"] == 1


def came_back(bench: Bench) -> None:
    bench.target.board.until(10, loader=None, usb={"state": "configured"})


def test_blocks_of_other_families_are_skipped_by_the_loader(bench: Bench, tmp_path: Path) -> None:
    """As UF2 files for several chips have them; the host would refuse such a file, the boot ROM takes it."""
    foreign = bytearray(bench.built.read_bytes()[:512])
    foreign[28:32] = (0xADA52840).to_bytes(4, "little")
    foreign[32:288] = bytes(256)  # would leave nothing to boot
    image = read_image(bench.built)
    mixed = Image(image.path, (*image.blocks[:1], bytes(foreign), bytes(512), *image.blocks[1:]), image.note)
    outcome = bench.flash(mixed)
    assert outcome.settings is not None


@pytest.mark.daily
def test_the_command_on_an_emulated_board(
    rig: Rig, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.need("flashing")
    monkeypatch.chdir(tmp_path)  # where the backup goes
    monkeypatch.setenv("BIOTAC_EMULATOR", str(ROOT / "tools/emulator"))
    assert (
        main(["flash", rig.facts["port"].format(source="press.toml", options="fingers=1"), str(rig.image), "--json"])
        == 0
    )
    facts = json.loads(capsys.readouterr().out)
    assert facts["firmware"] == facts["firmware_before"]
    assert facts["boot_id"] != facts["boot_id_before"]
    assert json.loads(Path(facts["backup"]).read_text())["settings"]
