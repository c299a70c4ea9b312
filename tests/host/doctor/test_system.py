"""The doctor's view of this computer, from trees of files, and the udev rule."""

import os
from pathlib import Path

import pytest
from doctor_facts import usb_port

from biotac.cli.main import main
from biotac.doctor import Facts, diagnose, udev
from biotac.doctor.system import look
from biotac.errors import InputError, PortError
from biotac.link.holders import Holder
from biotac.wire import messages_gen as wire

PORT = "/dev/ttyACM0"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "dev").mkdir()
    (tmp_path / "dev/ttyACM0").touch()
    (tmp_path / "proc").mkdir()
    return tmp_path


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def usb_device(root: Path, name: str, vendor: int, product: int) -> None:
    write(root / f"sys/bus/usb/devices/{name}/idVendor", f"{vendor:04x}\n")
    write(root / f"sys/bus/usb/devices/{name}/idProduct", f"{product:04x}\n")


def test_a_board_in_its_loader_is_seen_on_usb_and_as_a_drive(root: Path) -> None:
    assert look(None, root=root, entries=[]).loaders == []
    (root / "Volumes/RPI-RP2").mkdir(parents=True)
    assert look(None, root=root, entries=[]).loaders == [str(root / "Volumes/RPI-RP2")]
    usb_device(root, "1-1.2", 0x2E8A, 0x0003)
    usb_device(root, "usb1", 0x1D6B, 0x0002)
    write(root / "sys/bus/usb/devices/1-1:1.0/bInterfaceClass", "ff\n")
    assert look(None, root=root, entries=[]).loaders == ["USB 1-1.2"]


def test_a_board_without_a_port_is_seen_on_usb(root: Path) -> None:
    usb_device(root, "1-3", wire.USB_VENDOR, wire.USB_PRODUCT)
    facts = look(None, root=root, entries=[])
    assert facts.usb_boards == 1
    assert [f.code for f in diagnose(Facts(None, facts))] == ["no_serial_port"]


def test_modem_manager_is_in_the_way_unless_udev_says_otherwise(root: Path) -> None:
    write(root / "proc/71/comm", "ModemManager\n")
    assert look(PORT, root=root, entries=[]).modem_manager
    assert not look(PORT, root=root, entries=[]).left_alone
    assert not look("/dev/ttyS0", root=root, entries=[]).modem_manager  # it asks USB modems only
    write(root / "sys/class/tty/ttyACM0/dev", "166:0\n")
    write(root / "run/udev/data/c166:0", "S:serial/by-id/x\nE:ID_MM_DEVICE_IGNORE=0\n")
    assert not look(PORT, root=root, entries=[]).left_alone
    write(root / "run/udev/data/c166:0", "S:serial/by-id/x\nE:ID_MM_DEVICE_IGNORE=1\nG:uaccess\n")
    assert look(PORT, root=root, entries=[]).left_alone


def test_permission_and_holders_are_those_of_the_only_board_or_of_the_one_named(root: Path, monkeypatch) -> None:
    entry, other = usb_port(PORT, "A"), usb_port("/dev/ttyACM1", "B")
    (root / "proc/71/fd").mkdir(parents=True)
    (root / "proc/70").mkdir()  # another user's, or gone
    write(root / "proc/71/comm", "minicom\n")
    (root / "proc/71/fd/3").symlink_to(PORT)
    facts = look(None, root=root, entries=[entry])
    assert facts.permitted
    assert facts.holders == [Holder(71, "minicom")]
    assert look("serial:a", root=root, entries=[entry, other]).holders == facts.holders
    assert not look("serial:B", root=root, entries=[entry]).holders
    # Root may open everything, so the refusal is made up.
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    (root / "dev/ttyACM0").chmod(0o660)
    facts = look(None, root=root, entries=[entry])
    assert not facts.permitted
    assert facts.owner.endswith("mode 660")


# ---- the udev rule -------------------------------------------------------------------------------


def test_the_rule_has_the_firmwares_ids_and_silences_modem_manager(tmp_path: Path) -> None:
    path = tmp_path / "rules.d" / "70-biotac.rules"
    with pytest.raises(InputError, match="has no udev; udev rules are for Linux"):
        udev.install(path)
    path.parent.mkdir()
    udev.install(path)
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    assert f'ATTRS{{idVendor}}=="{wire.USB_VENDOR:04x}", ATTRS{{idProduct}}=="{wire.USB_PRODUCT:04x}"' in lines[0]
    assert all(
        'MODE="0660", GROUP="' in line and 'TAG+="uaccess"' in line for line in lines
    )  # over ssh there is no seat
    assert 'ENV{ID_MM_DEVICE_IGNORE}="1"' in lines[0]


def test_the_doctor_prints_the_rule_or_says_that_it_takes_root(tmp_path: Path, capsys, monkeypatch) -> None:
    assert main(["doctor", "--udev-rule", "print"]) == 0
    assert capsys.readouterr().out == udev.rule()

    def forbidden(self: Path, text: str) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "write_text", forbidden)
    with pytest.raises(PortError, match="run it as root: sudo biotac doctor --udev-rule install"):
        udev.install(tmp_path / "70-biotac.rules")
