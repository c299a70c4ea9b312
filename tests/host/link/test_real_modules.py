"""The stand-ins for spidev and smbus2, against the modules themselves: names, arguments, results, errors."""

import inspect
import json
import os
import subprocess
import sys
from pathlib import Path

import fake_smbus
import fake_spidev
import pytest

from biotac.sim.loading import load_source

spidev = pytest.importorskip("spidev", reason="spidev is not installed: pip install 'biotac-gateway[bus]' (Linux)")
smbus2 = pytest.importorskip("smbus2", reason="smbus2 is not installed: pip install 'biotac-gateway[bus]' (Linux)")
SHIM = Path(__file__).resolve().parent / "spi_shim.c"
#: The library's requests of a device, with each answer's type or the error, as JSON; for the fake and the real one.
ASK = """
import json
def ask(device):
    def tried(call):
        try:
            return type(call()).__name__
        except (OSError, TypeError) as error:
            return [type(error).__name__, getattr(error, "errno", None)]
    yield "missing", tried(lambda: device.open(7, 1))
    yield "open", tried(lambda: device.open(0, 0))
    device.mode, device.max_speed_hz, device.bits_per_word = 0, HZ, 8
    yield "set", [device.mode, device.max_speed_hz, device.bits_per_word]
    for values in ([0x83, 0], [1]):
        answer = device.xfer2(values)
        yield f"{len(values)} bytes", [type(answer).__name__, len(answer), sorted({type(v).__name__ for v in answer})]
    yield "nothing", tried(lambda: device.xfer2([]))
    yield "no sequence", tried(lambda: device.xfer2(3))
    yield "close", tried(device.close)
    yield "closed", tried(lambda: device.xfer2([1, 2]))
    yield "close again", tried(device.close)
"""


def test_the_fake_spidev_answers_as_the_real_one(tmp_path: Path) -> None:
    shim = tmp_path / "shim.so"
    subprocess.run(["cc", "-shared", "-fPIC", SHIM, "-o", shim, "-ldl"], check=True)
    program = (
        ASK.replace("HZ", str(fake_spidev.SPI_HZ)) + "\nimport spidev\nprint(json.dumps(list(ask(spidev.SpiDev()))))"
    )
    real = subprocess.run([sys.executable, "-c", program], env={**os.environ, "LD_PRELOAD": str(shim)}, check=True,
                          capture_output=True, text=True)  # fmt: skip
    names: dict = {}
    exec(ASK.replace("HZ", str(fake_spidev.SPI_HZ)), names)
    fake = fake_spidev.Bus(load_source("press.toml", fingers=1, seconds=1.0), tmp_path).module().SpiDev()
    assert json.loads(json.dumps(list(names["ask"](fake)))) == json.loads(real.stdout)


def test_the_fake_spidev_has_no_name_that_the_real_one_lacks(tmp_path: Path) -> None:
    fake = fake_spidev.Bus(load_source("press.toml", fingers=1, seconds=1.0), tmp_path).module().SpiDev()
    used = {name for name in [*dir(type(fake)), "mode", "max_speed_hz", "bits_per_word"] if not name.startswith("_")}
    assert used <= set(dir(spidev.SpiDev))


def test_the_fake_smbus2_has_the_real_ones_names_and_takes_what_it_takes() -> None:
    for fake, real in ((fake_smbus.Bus, smbus2.SMBus), (fake_smbus.Message, smbus2.i2c_msg)):
        names = [n for n, _ in inspect.getmembers(fake, callable) if not n.startswith("_")]
        assert names
        for name in names:
            ours, theirs = (inspect.signature(getattr(owner, name)) for owner in (fake, real))
            kinds = [[p.kind for p in signature.parameters.values()] for signature in (ours, theirs)]
            assert kinds[0] == kinds[1], name


def test_the_fake_smbus2s_messages_and_errors_are_the_real_ones() -> None:
    for message in (smbus2.i2c_msg, fake_smbus.Message):
        assert bytes(message.write(0x50, [1, 2])) == b"\1\2"
        read = message.read(0x50, 3)
        assert type(bytes(read)) is bytes
    with pytest.raises(FileNotFoundError) as real:
        smbus2.SMBus(77)
    with pytest.raises(FileNotFoundError) as fake:
        fake_smbus.Wires({}).module().SMBus(77)
    assert fake.value.errno == real.value.errno
