"""biotac flash: the order of the steps, and the state after each failure, with a fake board."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from fake_flash_board import NEW_SETTING, FakeBoard, drives_below, make_drive, make_image, no_waiting, note, plug_in

from biotac.cli.main import main
from biotac.errors import BiotacError, FlashError, InputError, NotAGatewayError
from biotac.flash import Backup, flash, read_backup, read_image
from biotac.flash import image as uf2_image
from biotac.flash.image import Image
from biotac.flash.procedure import flash_every
from biotac.hand.hand import Hand
from biotac.wire import messages_gen as wire


@pytest.fixture
def fake(scripted_board, hello, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> FakeBoard:
    monkeypatch.chdir(tmp_path)
    no_waiting(monkeypatch)
    return FakeBoard(scripted_board, hello)


@pytest.fixture
def ports(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    return plug_in(monkeypatch)


def backups(folder: Path) -> list[Path]:
    return sorted(folder.glob("biotac-settings-*.json"))


def test_settings_are_in_a_file_before_anything_is_touched(fake: FakeBoard, tmp_path: Path) -> None:
    seen: list[str] = []
    fake.events = _Watched(lambda event: seen.append(f"{event} with {len(backups(tmp_path))}"))
    outcome = flash(read_image(make_image(tmp_path)), fake, [fake])
    assert seen == ["loader with 1", "write with 1"]
    assert outcome.before is not None
    assert (outcome.before.firmware_minor, outcome.after.firmware_minor) == (1, 2)
    assert outcome.backup is not None
    assert read_backup(outcome.backup.path).values == fake.settings
    assert outcome.settings is not None
    assert outcome.settings.changed == ()
    facts = json.loads(outcome.backup.path.read_text())
    assert facts["settings"][-1] == {"id": NEW_SETTING, "name": f"setting {NEW_SETTING}", "value": 42}
    assert facts["firmware"] == "0.1.0"


class _Watched(list[str]):
    def __init__(self, watch: Callable[[str], None]) -> None:
        super().__init__()
        self._watch = watch

    def append(self, event: str) -> None:
        super().append(event)
        self._watch(event)


def test_what_differs_afterwards_is_restored_and_saved(fake: FakeBoard, tmp_path: Path) -> None:
    fake.settings |= {1: 2, 9: 250}  # in force, and not stored
    outcome = flash(read_image(make_image(tmp_path)), fake, [fake])
    assert fake.events == ["loader", "write", "set 1", "set 9", "save"]
    assert fake.stored[1] == 2
    assert fake.stored[9] == 250
    assert outcome.settings is not None
    assert outcome.settings.changed == ("poc_weights", "idle_period_ms")


def test_the_link_is_taken_before_the_loader_and_again_before_what_is_restored(fake: FakeBoard, tmp_path: Path) -> None:
    fake.settings |= {1: 2}
    flash(read_image(make_image(tmp_path)), fake, [fake], take_link=True)
    assert fake.events == ["take link", "loader", "write", "take link", "set 1", "save"]


def test_a_setting_that_the_new_firmware_has_not_is_named(fake: FakeBoard, tmp_path: Path) -> None:
    del fake.stored[NEW_SETTING]
    outcome = flash(read_image(make_image(tmp_path)), fake, [fake])
    assert outcome.settings is not None
    assert outcome.settings.unknown == (f"setting {NEW_SETTING}",)


def fails(fake: FakeBoard, folder: Path, kind: type[BiotacError] = FlashError, **options: object) -> str:
    with pytest.raises(kind) as caught:
        flash(read_image(make_image(folder)), fake, [fake], **options)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_the_two_picos_images_are_told_apart(fake: FakeBoard, tmp_path: Path) -> None:
    sensors = make_image(tmp_path, note(wire.BoardKind.PICO_SENSOR), "sensors.uf2")
    with pytest.raises(InputError, match="is for PICO_SENSOR, but PICO answers"):
        flash(read_image(sensors), fake, [fake])
    fake.board = int(wire.BoardKind.PICO_SENSOR)
    with pytest.raises(InputError, match="is for PICO, but PICO_SENSOR answers"):
        flash(read_image(make_image(tmp_path)), fake, [fake])
    assert fake.events == [] and backups(tmp_path) == []
    outcome = flash(read_image(sensors), fake, [fake])
    assert fake.events == ["loader", "write"]
    assert outcome.backup is None  # it keeps no settings
    backup = Backup(tmp_path / "other.json", {})
    with pytest.raises(InputError, match="keeps no settings"):
        flash(read_image(sensors), fake, [fake], restore_from=backup)


def test_an_image_of_another_wire_leaves_the_board_alone(fake: FakeBoard, tmp_path: Path) -> None:
    image = read_image(make_image(tmp_path, note(major=wire.WIRE_MAJOR + 1)))
    with pytest.raises(InputError, match="could not verify the result"):
        flash(image, fake, [fake])
    assert fake.events == []


def test_a_backup_is_never_written_over(fake: FakeBoard, tmp_path: Path) -> None:
    precious = tmp_path / "precious.json"
    precious.write_text("mine")
    assert "choose another --backup" in fails(fake, tmp_path, InputError, backup_path=precious)
    assert "choose another --backup" in fails(fake, tmp_path, InputError, backup_path=tmp_path / "no" / "x.json")
    assert precious.read_text() == "mine"
    assert fake.events == []


def test_the_old_version_coming_back_is_no_success(fake: FakeBoard, tmp_path: Path) -> None:
    fake.accepts = False
    message = fails(fake, tmp_path)
    assert "is PICO, firmware 0.1.0; expected PICO, firmware 0.2.0" in message
    assert str(backups(tmp_path)[0]) in message


def test_other_bytes_in_flash_are_no_success(fake: FakeBoard, tmp_path: Path) -> None:
    hello = fake.hello
    fake.hello = lambda payload, **facts: hello(payload, **facts | {"image_crc32": 0x1234})
    assert "flash has CRC-32 00001234, the image " in fails(fake, tmp_path)


def test_the_same_boot_is_no_success(fake: FakeBoard, tmp_path: Path) -> None:
    fake.boot_id -= 1
    hello = fake.hello
    fake.hello = lambda payload, **facts: hello(payload, **facts | {"boot_id": 6})
    assert "still has boot id 00000006" in fails(fake, tmp_path)


def test_another_board_coming_back_is_no_success(fake: FakeBoard, tmp_path: Path) -> None:
    write = fake.write

    def exchange(image: Image, show: Callable[[int, int], None]) -> None:
        write(image, show)
        fake.serial = (9,) * 12

    fake.write = exchange  # type: ignore[method-assign]
    assert "leave only one board plugged in" in fails(fake, tmp_path)


def test_a_board_that_never_comes_back_leaves_its_settings(fake: FakeBoard, tmp_path: Path) -> None:
    fake.comes_back = False
    message = fails(fake, tmp_path)
    assert "did not come back" in message
    assert message.endswith(f"the settings are saved in {backups(tmp_path)[0]}: restore them with --restore")


def test_a_value_that_is_not_taken_back_leaves_the_settings(fake: FakeBoard, tmp_path: Path) -> None:
    fake.settings[9] = 250
    fake.refuses = {9}
    message = fails(fake, tmp_path)
    assert "refused SetSetting: OUT_OF_RANGE" in message
    assert read_backup(backups(tmp_path)[0]).values[9] == 250


def test_a_board_that_does_not_enter_its_loader(fake: FakeBoard, tmp_path: Path) -> None:
    class Never(FakeBoard):
        ready = lambda self: False  # noqa: E731

    fake.__class__ = Never
    message = fails(fake, tmp_path)
    assert "no board in its loader was found within 20 s: hold BOOTSEL; then flash again" in message
    assert fake.events == ["loader"]


def test_a_board_in_its_loader_is_flashed_and_given_a_backup(fake: FakeBoard, tmp_path: Path) -> None:
    first = flash(read_image(make_image(tmp_path)), fake, [fake], backup_path=tmp_path / "kept.json")
    assert first.backup is not None
    fake.in_loader = True
    fake.stored[9] = 999
    kept = read_backup(tmp_path / "kept.json")
    outcome = flash(read_image(make_image(tmp_path)), fake, [fake], restore_from=kept)
    assert outcome.before is None
    assert fake.stored[9] == first.backup.values[9]
    fake.in_loader = True
    bare = flash(read_image(make_image(tmp_path)), fake, [fake])
    assert bare.settings is None


def test_a_backup_to_restore_goes_before_the_boards_own_settings(fake: FakeBoard, tmp_path: Path) -> None:
    image = read_image(make_image(tmp_path))
    flash(image, fake, [fake], backup_path=tmp_path / "first.json")
    fake.settings[9] = fake.stored[9] = 250
    flash(image, fake, [fake], backup_path=tmp_path / "own.json", restore_from=read_backup(tmp_path / "first.json"))
    assert fake.stored[9] == wire.SETTINGS[wire.Setting.IDLE_PERIOD_MS].default
    assert read_backup(tmp_path / "own.json").values[9] == 250
    fake.comes_back = False
    kept = read_backup(tmp_path / "first.json")
    assert "third.json: restore them with --restore" in fails(
        fake, tmp_path, backup_path=tmp_path / "third.json", restore_from=kept
    )


def test_a_setting_that_a_board_never_had_hides_none_behind_it(fake: FakeBoard, tmp_path: Path) -> None:
    del fake.settings[3], fake.stored[3]
    outcome = flash(read_image(make_image(tmp_path)), fake, [fake])
    assert outcome.backup is not None
    assert sorted(outcome.backup.values) == sorted(fake.settings)


def test_two_boards_are_not_mixed_up(fake: FakeBoard, tmp_path: Path) -> None:
    class Another(FakeBoard):
        ready = lambda self: True  # noqa: E731

    fake.__class__ = Another
    assert "another board is in its loader" in fails(fake, tmp_path, InputError)
    assert fake.events == []


def test_a_board_without_a_loader_is_not_flashed(fake: FakeBoard, tmp_path: Path) -> None:
    fake.refuses_loader = wire.Error.NOT_HERE
    assert "NOT_HERE" in fails(fake, tmp_path)
    assert fake.events == []


def test_firmware_that_does_not_answer_is_touched_only_when_told(
    fake: FakeBoard, tmp_path: Path, time_passes: Callable[[], bytes]
) -> None:
    fake.answers, fake.silence = False, time_passes
    assert "--no-backup" in fails(fake, tmp_path, NotAGatewayError)
    assert fake.events == []
    outcome = flash(read_image(make_image(tmp_path)), fake, [fake], keep=False)
    assert fake.events == ["touch", "write"]
    assert (outcome.before, outcome.backup) == (None, None)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "else"}', '{"format": "biotac-settings/1"}'])
def test_a_backup_that_is_none_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "backup.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"is not usable: .*; expected a file written by biotac flash"):
        read_backup(path)


# ---- the command -----------------------------------------------------------------------------------------


def refused(capsys: pytest.CaptureFixture[str], code: int, *words: str) -> str:
    assert main(["flash", *words]) == code
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1].startswith("biotac: ")
    return lines[-1]


def test_without_an_image_one_is_asked_for(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    package, is_file = Path(uf2_image.__file__).parent, Path.is_file
    monkeypatch.setattr(Path, "is_file", lambda path: path.parent != package and is_file(path))  # nothing is carried
    without = refused(capsys, 2)
    assert "built without a board image" in without and "name an IMAGE" in without
    assert "cannot be read" in refused(capsys, 2, "nowhere.uf2")
    built = tmp_path / "build/pico/biotac-pico.uf2"
    built.parent.mkdir(parents=True)
    built.write_bytes(b"none")
    assert f"{built} cannot be flashed: 4 bytes are not a UF2" in refused(capsys, 2)
    monkeypatch.setattr(Path, "is_file", lambda path: path.parent == package or is_file(path))
    assert uf2_image.find_image() == package / "biotac-pico.uf2"  # whatever is around


def test_ports_that_cannot_be_flashed(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, ports: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    drives_below(tmp_path, monkeypatch)
    image = str(make_image(tmp_path))
    assert "`biotac list`" in refused(capsys, 3, "/dev/ttyNOWHERE7", image)
    assert "no board found, running or in its loader" in refused(capsys, 3, image)
    assert "has no image to flash" in refused(capsys, 2, "sim:press.toml", image)
    assert "are not a UF2" in refused(capsys, 2, "--emulated", str(Path(__file__)))
    assert "drop one of them" in refused(capsys, 2, "--all", "/dev/ttyACM0", image)
    assert "use only one" in refused(capsys, 2, "--all", "--restore", "x", image)
    assert "no board is plugged in" in refused(capsys, 3, "--all", image)
    ports |= {"/dev/ttyACM0": "A", "/dev/ttyACM1": "B"}
    assert "2 boards are plugged in (/dev/ttyACM0, /dev/ttyACM1)" in refused(capsys, 3, image)


def test_the_whole_command_over_a_drive(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    ports: dict[str, str],
    fake: FakeBoard,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The fake board's loader is a folder that appears; a file in the folder makes the board restart."""
    ports[fake.port] = "E66"
    image = make_image(tmp_path)
    media = tmp_path / "media/me"
    media.mkdir(parents=True)

    def appear() -> None:
        drive = media / "RPI-RP2"
        if fake.in_loader and not drive.exists():
            make_drive(drive)

    def fsync(fd: int) -> None:
        if (media / "RPI-RP2/BIOTAC.UF2").stat().st_size == image.stat().st_size:
            fake.write(read_image(image), lambda done, of: None)

    drives_below(tmp_path, monkeypatch, appear)
    monkeypatch.setattr(os, "fsync", fsync)
    fake.settings[9] = 250
    assert main(["flash", str(image), "--json"]) == 0
    output = capsys.readouterr()
    facts = json.loads(output.out)
    assert (facts["firmware_before"], facts["firmware"]) == ("0.1.0", "0.2.0")
    assert (facts["boot_id_before"], facts["boot_id"]) == (7, 8)
    assert facts["settings_restored"] == ["idle_period_ms"]
    assert Path(facts["backup"]).is_file()
    assert "writing 20 blocks to the drive RPI-RP2" in output.err


def test_every_board_is_flashed_that_runs_something_else(scripted_board, hello, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    no_waiting(monkeypatch)
    image = read_image(make_image(tmp_path))
    first, mute, last = (FakeBoard(scripted_board, hello) for _ in range(3))
    last.serial = (4, 5, 6) + (0,) * 9  # the backup is named after it

    def nothing() -> Hand:
        raise NotAGatewayError("nothing answers")

    mute.open = nothing
    results = list(flash_every(image, [first, mute, last], [first, last]))
    assert [result.outcome is not None for result in results] == [True, False, True]
    assert isinstance(results[1].error, NotAGatewayError)
    assert (first.version, last.version) == ((0, 2, 0), (0, 2, 0))
    again = list(flash_every(image, [first, last], [first, last]))
    assert [(result.outcome, result.error) for result in again] == [(None, None)] * 2
    first.board = int(wire.BoardKind.PICO_W)  # the same chip, other pins: the old image stays
    for_picos = read_image(make_image(tmp_path, note(version=(0, 3, 0))))
    (left,) = flash_every(for_picos, [first], [first])
    assert (left.outcome, left.error) == (None, None) and "is a PICO_W, which new.uf2 is not for" in left.why
    assert first.events == last.events == ["loader", "write"]


def test_a_board_that_stays_in_its_loader_keeps_the_next_one_from_its_place(
    scripted_board, hello, tmp_path, monkeypatch
) -> None:
    """A loader has no serial number: an image written then would go to the first board."""
    monkeypatch.chdir(tmp_path)
    no_waiting(monkeypatch)
    first, second = (FakeBoard(scripted_board, hello) for _ in range(2))
    first.write = lambda image, show: (_ for _ in ()).throw(FlashError("took 3 of 20 blocks"))
    results = list(flash_every(read_image(make_image(tmp_path)), [first, second], [first]))
    assert "took 3 of 20" in str(results[0].error)
    assert "another board is in its loader" in str(results[1].error)
    assert second.events == []
