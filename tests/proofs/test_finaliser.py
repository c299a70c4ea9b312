"""The point of contact's last steps (to_radius in firmware/core/solve/poc.c): direction, length, rounding.

Gappa proves radius.g. Its hypotheses:
  root       every argument of the table, by tests/proofs/exhaustive.c, which is run here.
  direction  a component is rounded to half a unit, and the longest is at least 2^15; one that would be
             2^16 is held at 2^16 - 1, off by less than 1 in 65535. So the direction turns by at most
             sqrt(3) / 2 in 2^15, and no coordinate of a unit vector moves by more than that.
  cut        a square less its last two bits, which are 0 or 1 for every square: together at most 3 are
             missing from four times the quarter sum, which is at least 2^30.
  half       (inverse + 1) >> 1 adds at most half a unit, to what is wanted for squares from 2^32 to
             3 * 2^32.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from fractions import Fraction
from functools import cache
from math import isqrt
from pathlib import Path

import pytest

from prover import Report
from prover.source import CORE, changed, run_c, text_of
from prover.table import constants, doubles, table

HERE = Path(__file__).parent
RADIUS = table().radius_um
UM_FACTOR, UM_BITS, LEVER_FACTOR, LEVER_BITS, DIRECTION_BITS = constants(
    "solve/poc.c",
    *(f"BT_ROOT_{name}" for name in ("UM_FACTOR", "UM_BITS", "LEVER_FACTOR", "LEVER_BITS")),
    "DIRECTION_BITS",
)


@pytest.fixture
def gappa() -> str:
    """Debian's gappa; CI installs it (tools/test), and there its absence is an error."""
    found = shutil.which("gappa")
    if found is None:
        reason = "gappa is missing (Debian: gappa), so the finaliser's rounding is not proved here"
        if os.environ.get("BIOTAC_CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return found


@cache
def root_error(table_text: str, *arguments: str) -> tuple[Fraction, Fraction]:
    """Relative error of the table, over all of its arguments, rounded outwards."""
    program = text_of(HERE / "exhaustive.c")
    folder = Path(os.environ.get("TMPDIR", "/tmp"))
    source = folder / f"root_gen_{os.getpid()}.c"
    source.write_text(table_text, encoding="utf-8")
    try:
        printed = run_c(program, (CORE,), *arguments, sources=(source,))
    finally:
        source.unlink()
    low, high = re.findall(r"relative (\S+) (\S+)", printed)[0]
    outwards = Fraction(1, 10**9)  # it prints five digits of about 1e-5
    return Fraction(low) - outwards, Fraction(high) + outwards


def sqrt_up(value: Fraction, digits: int = 12) -> Fraction:
    scale = 10 ** (2 * digits)
    return Fraction(isqrt(value.numerator * scale // value.denominator) + 1, 10**digits)


def decimal(value: Fraction | int) -> str:
    """As Gappa reads it: whole numbers and quotients of them are exact."""
    fraction = Fraction(value)
    return f"({fraction.numerator} / {fraction.denominator})" if fraction.denominator > 1 else str(fraction.numerator)


def bound(value: Fraction) -> str:
    """Ends of intervals must be plain decimals: 15 digits, rounded outwards."""
    scaled = abs(value) * 10**15
    outward = -(-scaled.numerator // scaled.denominator)
    return f"{'-' if value < 0 else ''}{outward // 10**15}.{outward % 10**15:015d}"


def script(**changes: int) -> str:
    numbers = {"um_factor": UM_FACTOR, "lever_factor": LEVER_FACTOR, "direction_bits": DIRECTION_BITS} | changes
    low, high = root_error(text_of(CORE / "solve/rsqrt_gen.c"))
    share = Fraction(RADIUS, 2 * UM_FACTOR)
    smallest = share * (1 << 32) / sqrt_up(Fraction(3 << 30)) * (1 + low)  # of the table, where it is halved
    um_unit, lever_unit = 1 << UM_BITS, 1 << LEVER_BITS
    lever_gain = share * (1 << 32) / (1 << 15) * numbers["lever_factor"] / lever_unit * 10000 / (1 << 17) / RADIUS
    # A unit vector turned by an angle of sine s moves by less than s (1 + s^2).
    turn = sqrt_up(Fraction(3)) / (1 << numbers["direction_bits"])
    values = {
        "share": decimal(share),
        "radius": decimal(RADIUS),
        "um_factor": decimal(numbers["um_factor"]),
        "um_half": decimal(um_unit // 2),
        "um_unit": decimal(um_unit),
        "lever_factor": decimal(numbers["lever_factor"]),
        "lever_middle": decimal(numbers["lever_factor"] // 2 + lever_unit // 2),
        "lever_unit": decimal(lever_unit),
        "lever_gain": decimal(lever_gain),
        "direction": bound(turn * (1 + turn * turn)),
        "root_low": bound(low),
        "root_high": bound(high),
        "cut": bound(Fraction(3, 1 << 30)),
        "half": bound(Fraction(1, 1) / smallest),
    }
    return re.sub(r"@(\w+)@", lambda m: values[m[1]], text_of(HERE / "radius.g"))


def run(gappa: str, text: str) -> dict[str, tuple[float, float]]:
    """The intervals Gappa found, by the first words of what they bound."""
    done = subprocess.run([gappa], input=text, capture_output=True, text=True, check=False)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    number = r"(-?[\d.]+)(?:b-?\d+)?(?: \{(-?[\d.e+-]+),[^}]*\})?"
    found = {}
    for name, low, low_value, high, high_value in re.findall(rf"^\s*(\S.*?) in \[{number}, {number}\]", said, re.M):
        found[name] = float(low_value or low), float(high_value or high)
    return found


def interval(found: dict[str, tuple[float, float]], start: str) -> tuple[float, float]:
    (name,) = [key for key in found if key.startswith(start)]
    return found[name]


def test_a_coordinate_is_within_its_bound(gappa: str, proved: Report) -> None:
    found = run(gappa, script())
    low, high = interval(found, "um - ")
    largest = max(-low, high)
    # The bound of the test that judges the kernel, without what cut weights add: they are not this step's.
    direction_um, weights_um = doubles("kernel_bounds.h", "DIRECTION_UM", "0.28")
    claimed = 0.5 + direction_um - weights_um
    proved(f"{largest:.4f} um per coordinate, of {claimed:.4f} claimed, each way [{low:.4f}, {high:.4f}]")
    assert largest <= claimed


def test_the_lever_is_within_its_bound(gappa: str, proved: Report) -> None:
    low, high = interval(run(gappa, script()), "lever * ")
    proved(f"{max(-low, high):.4f} um of 0.0625 claimed")
    assert max(-low, high) <= 0.0625


def test_no_product_wraps(gappa: str, proved: Report) -> None:
    found = run(gappa, script())
    for name in ("at", "um_wide", "lever_wide"):
        low, high = interval(found, name)
        proved(f"{name} reaches {high:,.0f} of {2**32 - 1:,}")
        assert low >= 0 and high < 2**32


@pytest.mark.parametrize("changes", [{"um_factor": UM_FACTOR + 1}, {"direction_bits": DIRECTION_BITS - 1}])
def test_a_wrong_factor_and_one_bit_less_are_too_far_off(gappa: str, changes: dict[str, int]) -> None:
    """Gappa's bound grows beyond what is claimed; the constants it reads are the ones that matter."""
    text = script(**changes)
    if "um_factor" in changes:  # the error then is the factor's own: no longer a small rest of the identity
        text = changed(
            text, f"um - {RADIUS} * te ->", f"um - {RADIUS} * te -> {RADIUS} * t * (1 + inverse_error) / {UM_FACTOR} +"
        )
    low, high = interval(run(gappa, text), "um - ")
    direction_um, weights_um = doubles("kernel_bounds.h", "DIRECTION_UM", "0.28")
    assert max(-low, high) > 0.5 + direction_um - weights_um


def test_a_wrong_entry_of_the_table_is_found() -> None:
    text = text_of(CORE / "solve/rsqrt_gen.c")
    entry = re.findall(r"\b(\d{5}),", text)[200]
    with pytest.raises(ValueError, match="from the exact"):
        root_error(changed(text, entry, str(int(entry) + 3)))


@pytest.mark.nightly
def test_every_argument_of_the_table_one_by_one(proved: Report) -> None:
    """3 * 2^30 of them; root_error has the ends of each entry's range."""
    low, high = root_error(text_of(CORE / "solve/rsqrt_gen.c"), "all")
    assert (low, high) == root_error(text_of(CORE / "solve/rsqrt_gen.c"))
    proved(f"relative error from {float(low):.3g} to {float(high):.3g}")
