"""Gappa on the rounding of the published results: a point's last steps (to_radius in firmware/core/solve/poc.c), and
forces and torques (wrench.c). Constants are read from the C, by compiling it.

Gappa proves radius.g and wrench.g. The hypotheses of radius.g:
  root       every argument of the table, by tests/proofs/exhaustive.c, which is run here.
  direction  a component is rounded to half a unit, and the longest is at least 2^15; one that would be
             2^16 is held at 2^16 - 1, off by less than 1 in 65535. So the direction turns by at most
             sqrt(3) / 2 in 2^15, and no coordinate of a unit vector moves by more than that.
  cut        a square less the last two bits, which are 0 or 1 for every square: together at most 3 are
             missing from four times the quarter sum, which is at least 2^30.
  half       (inverse + 1) >> 1 adds at most half a unit to the true value, for squares from 2^32 to
             3 * 2^32.
"""

import os
import re
import shutil
import subprocess
import tempfile
from fractions import Fraction
from functools import cache
from math import isqrt
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
CORE = ROOT / "firmware/core"
ROOT_TABLE = (CORE / "solve/rsqrt_gen.c").read_text(encoding="utf-8")


def run_c(text: str, *arguments: str, sources: tuple[Path, ...] = ()) -> str:
    """Compile a program, run it and return the output. Raises ValueError with the output if it fails."""
    with tempfile.TemporaryDirectory() as folder:
        main, program = Path(folder, "main.c"), Path(folder, "program")
        main.write_text(text, encoding="utf-8")
        includes = [f"-I{path}" for path in (CORE, ROOT / "firmware/reference")]
        flags = ("-std=c11", "-O2", "-Wall", "-Wextra", "-Werror")
        subprocess.run(
            [os.environ.get("CC", "cc"), *flags, *includes, main, *sources, "-lm", "-o", program], check=True
        )
        done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise ValueError(done.stdout + done.stderr)
    return done.stdout


def numbers(include: str, *expressions: str) -> list[float]:
    """Values of expressions where this file of the core is included; whole numbers up to 2^53 exactly."""
    prints = "".join(f'    printf("%.17g\\n", (double)({expression}));\n' for expression in expressions)
    rest = tuple(CORE / f"{name}.c" for name in ("solve/rsqrt_gen", "signal/sums_gen", "wire/sensor_gen"))
    text = f'#include <stdio.h>\n#include "{include}"\nint main(void)\n{{\n{prints}    return 0;\n}}\n'
    return [float(line) for line in run_c(text, sources=rest).split()]


RADIUS, UM_FACTOR, UM_BITS, LEVER_FACTOR, LEVER_BITS, DIRECTION_BITS = map(
    int,
    numbers(
        "solve/poc.c",
        "BT_CORE_RADIUS_UM",
        *(f"BT_ROOT_{name}" for name in ("UM_FACTOR", "UM_BITS", "LEVER_FACTOR", "LEVER_BITS")),
        "DIRECTION_BITS",
    ),
)


@pytest.fixture
def gappa() -> str:
    """Debian's gappa; CI installs it (tools/test), and a CI without it is an error."""
    found = shutil.which("gappa")
    if found is None:
        reason = "gappa is missing (Debian: gappa), so rounding is not proved here"
        if os.environ.get("BIOTAC_CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return found


@cache
def root_error(table: str = ROOT_TABLE, *arguments: str) -> tuple[Fraction, Fraction]:
    """Relative error of the table, over all arguments, rounded outwards."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "table.c")
        source.write_text(table, encoding="utf-8")
        printed = run_c((HERE / "exhaustive.c").read_text(encoding="utf-8"), *arguments, sources=(source,))
    low, high = re.findall(r"relative (\S+) (\S+)", printed)[0]
    outwards = Fraction(1, 10**9)  # it prints five digits of about 1e-5
    return Fraction(low) - outwards, Fraction(high) + outwards


def sqrt_up(value: Fraction, digits: int = 12) -> Fraction:
    scale = 10 ** (2 * digits)
    return Fraction(isqrt(value.numerator * scale // value.denominator) + 1, 10**digits)


def decimal(value: Fraction | int) -> str:
    """A number as Gappa reads it: whole numbers and quotients of them are exact."""
    fraction = Fraction(value)
    return f"({fraction.numerator} / {fraction.denominator})" if fraction.denominator > 1 else str(fraction.numerator)


def bound(value: Fraction) -> str:
    """Ends of intervals must be plain decimals: 15 digits, rounded outwards."""
    scaled = abs(value) * 10**15
    outward = -(-scaled.numerator // scaled.denominator)
    return f"{'-' if value < 0 else ''}{outward // 10**15}.{outward % 10**15:015d}"


def radius(**changes: int) -> str:
    """radius.g, with the numbers filled in."""
    chosen = {"um_factor": UM_FACTOR, "lever_factor": LEVER_FACTOR, "direction_bits": DIRECTION_BITS} | changes
    low, high = root_error()
    share = Fraction(RADIUS, 2 * UM_FACTOR)
    smallest = share * (1 << 32) / sqrt_up(Fraction(3 << 30)) * (1 + low)  # of the table, where it is halved
    um_unit, lever_unit = 1 << UM_BITS, 1 << LEVER_BITS
    lever_gain = share * (1 << 32) / (1 << 15) * chosen["lever_factor"] / lever_unit * 10000 / (1 << 17) / RADIUS
    # A unit vector turned by an angle of sine s moves by less than s (1 + s^2).
    turn = sqrt_up(Fraction(3)) / (1 << chosen["direction_bits"])
    values = {
        "share": decimal(share),
        "radius": decimal(RADIUS),
        "um_factor": decimal(chosen["um_factor"]),
        "um_half": decimal(um_unit // 2),
        "um_unit": decimal(um_unit),
        "lever_factor": decimal(chosen["lever_factor"]),
        "lever_middle": decimal(chosen["lever_factor"] // 2 + lever_unit // 2),
        "lever_unit": decimal(lever_unit),
        "lever_gain": decimal(lever_gain),
        "direction": bound(turn * (1 + turn * turn)),
        "root_low": bound(low),
        "root_high": bound(high),
        "cut": bound(Fraction(3, 1 << 30)),
        "half": bound(Fraction(1, 1) / smallest),
    }
    return filled("radius.g", values)


def wrench() -> str:
    """wrench.g, with the numbers filled in; the largest sums are those that wrench.c asserts."""
    names = {
        "force_unit": "1ll << FORCE_BITS",
        "force_divisor": "FORCE_DIVISOR",
        "torque_unit": "1ll << TORQUE_BITS",
        "torque_divisor": "TORQUE_DIVISOR",
        "gain_max": "BT_GAIN_MAX_NN",
        "force_sum_max": "BT_SUM_NORMAL_MAX_Q4_MILLI",
        "torque_sum_max": "INT32_MAX",
        "split": "1 << LEVER_SPLIT_BITS",
        "lever_rest": "1 << (LEVER_BITS - LEVER_SPLIT_BITS)",
    }
    found = map(int, numbers("solve/wrench.c", *names.values()))
    return filled("wrench.g", dict(zip(names, map(str, found), strict=True)))


def filled(name: str, values: dict[str, str]) -> str:
    return re.sub(r"@(\w+)@", lambda m: values[m[1]], (HERE / name).read_text(encoding="utf-8"))


def run(gappa: str, text: str) -> dict[str, tuple[float, float]]:
    """The intervals that Gappa found, by the expression bounded."""
    done = subprocess.run([gappa], input=text, capture_output=True, text=True, check=False)
    text = done.stdout + done.stderr
    assert done.returncode == 0, text
    number = r"(-?[\d.]+)(?:b-?\d+)?(?: \{(-?[\d.e+-]+),[^}]*\})?"
    found = {}
    for name, low, low_value, high, high_value in re.findall(rf"^\s*(\S.*?) in \[{number}, {number}\]", text, re.M):
        found[name] = float(low_value or low), float(high_value or high)
    return found


def interval(found: dict[str, tuple[float, float]], start: str) -> tuple[float, float]:
    (name,) = [key for key in found if key.startswith(start)]
    return found[name]


def largest(found: dict[str, tuple[float, float]], start: str) -> float:
    low, high = interval(found, start)
    return max(-low, high)


def claimed_um() -> float:
    """The bound of the test that judges the kernel, less the cut weights' part: they are not this step's."""
    direction_um, weights_um = numbers("kernel_bounds.h", "DIRECTION_UM", "0.28")
    return 0.5 + direction_um - weights_um


def test_a_coordinate_and_its_lever_are_within_their_bounds(gappa: str) -> None:
    found = run(gappa, radius())
    assert largest(found, "um - ") <= claimed_um()
    assert largest(found, "lever * ") <= 0.0625


def test_no_product_wraps(gappa: str) -> None:
    found = run(gappa, radius())
    for name in ("at", "um_wide", "lever_wide"):
        low, high = interval(found, name)
        assert low >= 0 and high < 2**32


def test_forces_and_torques_are_within_their_bounds(gappa: str) -> None:
    """Those of kernel_bounds.h: a unit is 0.1 mN or 1 mN*mm, the multiplier's half unit weighs as the sum does."""
    found = run(gappa, wrench())
    assert largest(found, "force - ") / 10 <= numbers("kernel_bounds.h", "FORCE_BOUND_MN")[0]
    assert largest(found, "torque - ") <= 0.5 + 2**31 / 2**36
    assert largest(found, "lever - ") <= 0.5625


@pytest.mark.parametrize("changes", [{"um_factor": UM_FACTOR + 1}, {"direction_bits": DIRECTION_BITS - 1}])
def test_a_wrong_factor_and_one_bit_less_are_too_far_off(gappa: str, changes: dict[str, int]) -> None:
    """Gappa's bound grows beyond the claim; the constants that Gappa reads are the ones that matter."""
    text = radius(**changes)
    if "um_factor" in changes:  # then the error is the factor's own: no longer a small rest of the identity
        old = f"um - {RADIUS} * te ->"
        assert text.count(old) == 1
        text = text.replace(old, f"{old} {RADIUS} * t * (1 + inverse_error) / {UM_FACTOR} +")
    assert largest(run(gappa, text), "um - ") > claimed_um()


def test_a_wrong_entry_of_the_table_is_found() -> None:
    entry = re.findall(r"\b(\d{5}),", ROOT_TABLE)[200]
    assert ROOT_TABLE.count(entry) == 1
    with pytest.raises(ValueError, match="from the exact"):
        root_error(ROOT_TABLE.replace(entry, str(int(entry) + 3)))


@pytest.mark.nightly
def test_every_argument_one_by_one() -> None:
    """3 * 2^30 of the table, where root_error has the ends of each entry's range; 2^32 of fixed_point.h's helpers."""
    assert root_error(ROOT_TABLE, "all") == root_error()
