"""The emulated boards are rigs of tests/hil, prepared in the same way."""

import pytest

from rig import all_rigs, require


@pytest.fixture(scope="session")
def emulated_pico() -> None:
    """The Pico's image and the emulator."""
    require(all_rigs()["pico_emulated"])


@pytest.fixture(scope="session")
def two_picos() -> None:
    """The same, and the image of a sensor board."""
    require(all_rigs()["two_picos"])
