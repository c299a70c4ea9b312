"""The touches that a wrench map was fitted to, and how like them another touch is (firmware/core/map/lesson.h).

Defined in integers, so that all boards agree: this is firmware/core/map/lesson.c once more, in NumPy.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..kernels.geometry import Floats
from ..wire.native import lib
from .margin import Margin

Integers = npt.NDArray[np.int64]

FACTORS, ROWS = lib.BT_FACTORS_OF_LESSON, lib.BT_ROWS_OF_LESSON
VERSION = lib.BT_VERSION_OF_LESSON  # of the factors
_HEAD = struct.Struct("<6H4B")
BYTES = _HEAD.size + 2 * ROWS * FACTORS
ALL = 256
_ROW_MAX, _WEIGHT_MAX, _DISTANCE_BITS, _EXPONENT_MAX = 65535, 32767, 14, 20
_LEAST_100UN, _SIZE_DOWN, _SIZE_BITS = 4096, 10, 13
_SCALE_MAX_Q8 = 1024
_NEAR_Q8, _FAR_Q8, _BEYOND_Q8 = 96, 1280, 1536
_FURTHEST_Q8 = 1 << 20
_FORCE_MAX_N = 400.0
_SHEAR_PER_N = 1000 / 64

# ... and how it is made.
_LEAST_N = 0.5  # lighter touches are mostly noise
_TYPICAL, _LARGEST = 0.97, 0.995  # of the lesson's frames are nearer than 1, and within the limits
_FLOOR = 1e-3  # a feature that hardly varies in the lesson must not alone decide
_RIDGE = 1e-3  # nor a combination of several


@dataclass(frozen=True)
class Seen:
    """A map's values for n frames: the lesson's ``factors`` (n, 10), and ``force_100un`` (n, 3)."""

    factors: Integers
    force_100un: Integers

    @property
    def size_100un(self) -> Integers:
        """Of the force (n,)."""
        found: Integers = np.abs(self.force_100un).sum(axis=1) + _LEAST_100UN
        return found

    @property
    def size(self) -> Integers:
        """The same, in the unit of the largest."""
        return self.size_100un >> _SIZE_DOWN


@dataclass(frozen=True)
class Lesson:
    """``weights`` (6, 10) of factors over 2^``exponent``; the largest size of a force; the factor of the population
    map's force that fits this finger, in 1/256, and the margin of that; the largest shear in 64 mN, and the least share
    of z in the size, in 1/256; counts of pressure per newton. 0: unknown.
    """

    exponent: int
    weights: tuple[tuple[int, ...], ...]
    size_max: int
    scale_q8: int
    margin: Margin
    shear_max: int = 0
    z_least_q8: int = 0
    counts_per_n: int = 0

    def packed(self) -> bytes:
        """The bytes in a map's blob. Raises struct.error."""
        (normal_mn, shear_mn), (normal_q8, shear_q8) = self.margin.base_mn, self.margin.share_q8
        margin = normal_mn, normal_q8, shear_mn, shear_q8
        limits = self.shear_max, self.z_least_q8, self.counts_per_n
        head = _HEAD.pack(self.scale_q8, self.size_max, *margin, self.exponent, *limits)
        side_by_side = np.array(self.weights).reshape(ROWS // 3, 3, FACTORS).swapaxes(1, 2).ravel()
        return head + struct.pack(f"<{ROWS * FACTORS}h", *side_by_side.tolist())

    @classmethod
    def unpacked(cls, data: bytes) -> Lesson:
        """Inverse of packed()."""
        scale_q8, size_max, normal_mn, normal_q8, shear_mn, shear_q8, exponent, *limits = _HEAD.unpack_from(data)
        flat = np.frombuffer(data, "<i2", ROWS * FACTORS, _HEAD.size)
        rows = flat.reshape(ROWS // 3, FACTORS, 3).swapaxes(1, 2).reshape(ROWS, FACTORS)
        margin = Margin((normal_mn, shear_mn), (normal_q8, shear_q8))
        return cls(exponent, tuple(tuple(row.tolist()) for row in rows), size_max, scale_q8, margin, *limits)

    def to_dict(self) -> dict[str, Any]:
        """The lesson as JSON types, for a map's file."""
        return {"version": VERSION, "bytes": self.packed().hex()}

    @classmethod
    def from_dict(cls, facts: Any) -> Lesson | None:
        """Inverse of to_dict; None for no lesson, or an older one. Raises ValueError, KeyError or TypeError."""
        older = isinstance(facts, str)  # without a version
        if facts is None or older or facts["version"] != VERSION:
            return None
        return cls.unpacked(bytes.fromhex(facts["bytes"]))

    def unlike_q8(self, seen: Seen) -> Integers:
        """How far (n,) touches are from the lesson, squared."""
        off = np.abs(seen.factors @ np.array(self.weights, np.int64).T >> self.exponent)
        per_size = seen.factors[:, 0] ** 2 >> 14
        beyond = np.maximum(seen.size - self.size_max, 0) * _BEYOND_Q8 // self.size_max
        if self.z_least_q8:
            lacks = self.z_least_q8 * (seen.size_100un >> 8) - seen.force_100un[:, 2]
            beyond += np.maximum(lacks, 0) >> np.frexp(seen.size_100un)[1] - _SIZE_BITS
        found: Integers = np.where(
            (off >> _DISTANCE_BITS).any(axis=1), _FURTHEST_Q8, (off**2).sum(axis=1) // per_size + beyond
        )
        return found

    def match(self, seen: Seen) -> LessonMatch:
        """The map's share of the force (n,), and the share of the population map's margin that is added."""
        unlike = self.unlike_q8(seen)
        return LessonMatch(self, np.clip(_FAR_Q8 - unlike >> 2, 0, ALL), np.clip(unlike - _NEAR_Q8, 0, ALL))


@dataclass(frozen=True)
class LessonMatch:
    """n frames compared with a lesson: ``share`` and ``apart`` (n,), in 1/256."""

    lesson: Lesson
    share: Integers
    apart: Integers

    def mixed(self, force_n: Floats, otherwise_n: Floats) -> Floats:
        """The map's force (n, 3) in N, mixed with the population map's."""
        part = (self.share / ALL)[:, None]
        quarter = _FORCE_MAX_N / 4
        other = np.clip(otherwise_n, -quarter, quarter) * (self.lesson.scale_q8 / ALL)
        mixed: Floats = np.where(
            part < 1, other + part * (np.clip(force_n, -_FORCE_MAX_N, _FORCE_MAX_N) - other), force_n
        )
        return mixed

    def half_n(self, parts_n: Floats, guess_n: Floats) -> Floats:
        """Added to the half widths (n, 2) of normal and shear ``parts_n`` (n, 2); ``guess_n`` (n, 2) is the
        population map's.
        """
        apart, rest = self.apart[:, None], (1 - self.share / ALL)[:, None]
        margin = self.lesson.margin
        base_mn, share_q8 = (np.array(whole) * apart // ALL for whole in (margin.base_mn, margin.share_q8))
        half: Floats = base_mn / 1000.0 + parts_n.sum(axis=1, keepdims=True) * share_q8 / ALL
        if self.lesson.shear_max:
            beyond = 2 * np.maximum(parts_n[:, 1:] - self.lesson.shear_max / _SHEAR_PER_N, 0)
            half += np.hstack([np.maximum(beyond, (beyond > 0) * parts_n[:, :1] / 4), beyond])
        return half + rest * guess_n * (self.lesson.scale_q8 / ALL)


def fit_lesson(seen: Seen, size_n: Floats, scale: float, margin: Margin, shear_n: Floats) -> Lesson:
    """The lesson of touches seen by a board's map, with forces of ``size_n`` (n,); ``shear_n`` (n,) is by the map,
    NaN without a point of contact.
    """
    firm = size_n > _LEAST_N
    features = seen.factors[firm, 1:] / seen.factors[firm, :1]
    mean, sd = features.mean(axis=0), features.std(axis=0) + _FLOOR
    variance, direction = np.linalg.eigh(np.cov(((features - mean) / sd).T) + _RIDGE * np.eye(FACTORS - 1))
    rows = (direction / np.sqrt(variance)).T[:ROWS] / sd  # in the order of variance: those that vary least
    typical = np.quantile((((features - mean) @ rows.T) ** 2).sum(axis=1), _TYPICAL)
    rows /= 8 * np.sqrt(typical)
    values = np.column_stack([-rows @ mean, rows])
    exponent = next(
        exponent for exponent in range(_EXPONENT_MAX, -1, -1)
        if np.abs(values).max() * 2.0**exponent <= _WEIGHT_MAX
        and (np.abs(values) * 2.0**exponent + 0.5).sum(axis=1).max() <= _ROW_MAX
    )  # fmt: skip
    weights = np.rint(values * 2.0**exponent).astype(int)
    scale_q8 = int(np.clip(np.rint(scale * ALL), 0, _SCALE_MAX_Q8))
    size_max = int(np.clip(np.quantile(seen.size[firm], _LARGEST), 1, 65535))
    shear_max = int(np.clip(np.ceil(np.nanquantile(shear_n[firm], _LARGEST) * _SHEAR_PER_N), 1, 255))
    z_share = np.quantile(seen.force_100un[firm, 2] / seen.size_100un[firm], 1 - _LARGEST)
    z_least_q8 = int(np.clip(np.floor(z_share * ALL), 0, 255))
    rows_of = tuple(tuple(row.tolist()) for row in weights)
    return Lesson(exponent, rows_of, size_max, scale_q8, margin, shear_max, z_least_q8)
