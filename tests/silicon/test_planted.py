"""Faults planted in the RP2350's port: each is red on the model of the chip's rules, and so is each wrong number."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PORT = "firmware/port"
START, REGS, FLASH = (f"{PORT}/rp2350/chip_{part}.h" for part in ("start", "regs", "flash"))
ROM = f"{PORT}/rp2350/rom.c"
SYSTEM, SLOT, SPI, USB = (f"{PORT}/rp2/{part}.c" for part in ("system", "slot", "spi", "usb/controller"))
HEARS = "each_finger_hears_its_word"
#: A file, words in it, the fault in their place, and the rule or the test that must be red.
PLANTS = {
    "clk_ref's divider left as the ROM had it": (START, "CLK_REF_DIV = CLK_DIV_ONE;", "", "divider left"),
    "clk_peri's": (START, "CLK_PERI_DIV = CLK_DIV_ONE;", "", "divider left"),
    "clk_usb's": (START, "CLK_USB_DIV = CLK_DIV_ONE;", "", "its clock divided"),
    "clk_adc's": (START, "CLK_ADC_DIV = CLK_DIV_ONE;", "", "divider left"),
    "the timer's tick not started": (START, "TICKS_TIMER0_CTRL = TICKS_ENABLE;", "", "without a tick"),
    "a tick of another crystal": (START, "TICK_CYCLES 12u", "TICK_CYCLES 10u", "without a tick"),
    "the watchdog left off": (START, "WATCHDOG_ENABLE | WATCHDOG_PAUSE", "WATCHDOG_PAUSE", "without a watchdog"),
    "PSM's bits of the RP2040": (REGS, "0x01FFFFF3u", "0x0001FFFCu", "without a watchdog"),
    "the watchdog's load of the RP2040": (REGS, "LOADS_OF_A_US 1u", "LOADS_OF_A_US 2u", "not two seconds"),
    "the LED's pad left isolated": (SYSTEM, "(PIN_LED) = PADS", "(PIN_LED) = 1u << 8 | PADS", "the_led_tells"),
    "the bus's pads left isolated": (SPI, "PADS_IE;\n    IO", "PADS_IE | 1u << 8;\n    IO", "isolated"),
    "the PHY left isolated": (USB, "USB_MAIN_CTRL = USB", "REG_SET(USB_MAIN_CTRL) = USB", "PHY"),
    "D+ pulled down": (USB, "USB_SIE_CTRL = USB_SIE_E", "REG_SET(USB_SIE_CTRL) = USB_SIE_E", "up and"),
    "E5: a dealer aborted while on": (SLOT, "REG_CLR(DMA_CTRL(DMA_DEALER)) = DMA_CHANNEL_EN;", "", "E5"),
    "E5: the worker left off after it": (SLOT, "        set_up_worker();\n", "", HEARS),
    "DMA bits of the RP2040": (REGS, "(0x3Bu << 17)", "(0x3Bu << 15)", "control blocks"),
    "OUTOVER of the RP2040": (REGS, "(3u << 12)", "(3u << 8)", HEARS),
    "SIO's OUT_CLR of the RP2040": (REGS, "0xD0000020u", "0xD0000018u", HEARS),
    "SPI0's reset bit of the RP2040": (REGS, "_SPI0       (1u << 18)", "_SPI0 (1u << 16)", "while in reset"),
    "the timer's reset bit of the RP2040": (REGS, "_TIMER      (1u << 23)", "_TIMER (1u << 21)", "while in reset"),
    "the clocks where the RP2040 has them": (REGS, "0x40010000u", "0x40008000u", "nothing of ours"),
    "the flash's select not asserted": (FLASH, "= QMI_DIRECT_CSR_ASSERT_CS;", "= 0;", "direct mode"),
    "direct mode left on": (FLASH, "    REG_CLR(QMI_DIRECT_CSR) = QMI_DIRECT_CSR_EN;\n", "", "turns over"),
    "an answer that has not come": (FLASH, "sent && !(status & QMI_DIRECT_CSR_RXEMPTY)", "sent", "not come"),
    "bytes to a full FIFO": (FLASH, "sent < bytes && !(status & QMI_DIRECT_CSR_TXFULL)", "sent < bytes", "no room"),
    "a Pico's flash size": (FLASH, "(4u * 1024 * 1024)", "(2u * 1024 * 1024)", "beside what is kept"),
    "ROM functions of RISC-V": (ROM, "FOR_ARM_SECURE    4u", "FOR_ARM_SECURE    1u", "Arm Secure"),
    "the loader by the RP2040's name": (ROM, "rom_function('R', 'B')", "rom_function('U', 'B')", "the_rom_restarts"),
    "no reboot into BOOTSEL": (ROM, "REBOOT_TO_BOOTSEL 2u", "REBOOT_TO_BOOTSEL 0u", "into the loader's"),
    "clk_sys at 150 MHz": (SYSTEM, "125, 6, 2)", "125, 5, 2)", "125 MHz"),
    "clk_usb at 60 MHz": (SYSTEM, "100, 5, 5)", "100, 5, 4)", "48 MHz"),
    "MISO pulled up": (SPI, "PADS_SCHMITT | PADS_PDE", "PADS_SCHMITT | PADS_PUE", "pull-down"),
    "USB by the RP2040's interrupt": (USB, "use_interrupt(USBCTRL_IRQ,", "use_interrupt(5,", "none of ours"),
    "the flash not made readable": (FLASH, "    rom_read_again();", "", "the_flash_tells"),
}


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A copy of the sources that builds and passes the chip's test."""
    copy = tmp_path_factory.mktemp("planted") / "tree"
    for name in ("firmware", "tools/silicon", "host/binding", "tests", "protocol"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__", "*.mcap"))
    shutil.copy(ROOT / "CMakeLists.txt", copy)
    command = ["cmake", "-S", str(copy), "-B", str(copy / "build"), "-G", "Ninja", "-DBIOTAC_TESTS=ON"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "PASSED" in told(copy)
    yield copy
    shutil.rmtree(copy)


def told(tree: Path) -> str:
    """Output of the chip's test on the tree."""
    built = subprocess.run(
        ["cmake", "--build", str(tree / "build"), "--target", "test_rp2350"], capture_output=True, text=True
    )
    assert built.returncode == 0, built.stdout[-2000:]
    test = next(path for path in (tree / "build").rglob("test_rp2350") if path.is_file())
    done = subprocess.run([str(test)], capture_output=True, text=True, timeout=60, check=False)
    return done.stdout + done.stderr if done.returncode else "PASSED"


@pytest.mark.nightly  # the worth of the rules; by day the ports pass them, in ctest
@pytest.mark.parametrize("fault", PLANTS)
def test_a_planted_fault_is_red(tree: Path, fault: str) -> None:
    name, words, instead, rule = PLANTS[fault]
    file = tree / name
    whole = file.read_text(encoding="utf-8")
    assert words in whole, f"{words} is no more in {name}; plant the fault elsewhere"
    file.write_text(whole.replace(words, instead), encoding="utf-8")
    try:
        assert rule in told(tree)
    finally:
        file.write_text(whole, encoding="utf-8")


def test_every_number_of_the_port_is_the_vendors() -> None:
    done = subprocess.run([ROOT / "tools/silicon/published"], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and " numbers agree" in done.stdout, done.stdout + done.stderr
