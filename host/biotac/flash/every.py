"""One image onto every board of this computer, one after the other: a loader does not say which board it is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from ..errors import BiotacError
from .image import Image
from .loader import Loader, Show
from .procedure import Outcome, Say, flash
from .target import Target


@dataclass(frozen=True)
class Result:
    """``outcome`` is None for a board that ran this very image before, and where there is an ``error``."""

    port: str
    outcome: Outcome | None = None
    error: BiotacError | None = None


def flash_every(
    image: Image,
    targets: Iterable[Target],
    loaders: Sequence[Loader],
    *,
    keep: bool = True,
    downgrade: bool = False,
    say: Say = lambda text: None,
    show: Show = lambda done, of: None,
) -> Iterator[Result]:
    """Flash each board as ``flash`` does, unless it runs this very image; what fails is told, and the next one done."""
    for target in targets:
        try:
            if runs(image, target):
                yield Result(target.port)
                continue
            outcome = flash(image, target, loaders, keep=keep, downgrade=downgrade, say=say, show=show)
            yield Result(target.port, outcome)
        except BiotacError as error:
            yield Result(target.port, error=error)
        finally:
            target.close()


def runs(image: Image, target: Target) -> bool:
    """The board says so; one that does not answer runs something else."""
    try:
        with target.open() as hand:
            return bool(hand.info.image_crc32 == image.note.crc32)
    except BiotacError:
        return False
