"""Guides a person, or a scenario, through presses on a board."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from ...errors import InputError
from ...hand.hand import Hand
from ...wire.batches import Batch
from .detector import Phase, Press, Procedure, Step
from .force_source import Reference
from .rows import rows_of


class Face(Protocol):
    """The user interface of a guided procedure."""

    def show(self, step: Step | None) -> None:
        """Show the next thing to do; None when all is done."""

    def force_n(self, step: Step) -> float:
        """The force in N at the press just held, as a scale shows it; asked only without a reference."""


class Unattended:
    """A Face for scenarios, which press by themselves."""

    def show(self, step: Step | None) -> None:
        pass

    def force_n(self, step: Step) -> float:
        raise InputError(f"finger {step.finger}, press {step.press} has no force; expected a reference")


def guide(
    hand: Hand,
    procedure: Procedure,
    reference: Reference | None,
    face: Face,
    *,
    after_us: int = 0,
    heard: Callable[[Batch], None] = lambda batch: None,
) -> dict[int, list[Press]]:
    """Feed ``procedure`` with what ``hand`` streams until it is done; the presses by finger, each with its force.

    The force is the ``reference``'s, or what ``face`` gives. Starts the stream if necessary and leaves it on. ``heard``
    gets every batch; ``procedure`` does not get the first ``after_us`` of device time. Raises InputError when a finger
    waits too long, or a simulated source ends first.
    """
    asked: dict[tuple[int, int], float] = {}

    def show(step: Step | None) -> None:
        if reference is None:
            _ask_forces(procedure, asked, face)
        face.show(step)

    shown = procedure.step
    show(shown)
    first_us: int | None = None
    for batch in hand.batches():
        heard(batch)
        rows = rows_of(batch.wire, batch.t_us, reference)
        if first_us is None and len(rows):
            first_us = int(rows["t_us"].min())
        procedure.feed(rows[rows["t_us"] - (first_us or 0) >= after_us])
        if procedure.step != shown:
            shown = procedure.step
            show(shown)
        if procedure.done:
            break
    procedure.finish()
    return {
        finger: [press.with_force(asked[finger, press.number]) if asked else press for press in presses]
        for finger, presses in procedure.presses.items()
    }


def _ask_forces(procedure: Procedure, asked: dict[tuple[int, int], float], face: Face) -> None:
    """Ask for the force of every press without one: several, when somebody presses faster than they type."""
    for finger, presses in procedure.presses.items():
        for press in presses:
            if (finger, press.number) not in asked:
                force_n = procedure.forces_n[press.number - 1]
                step = Step(finger, Phase.RELEASE, press.number, len(procedure.forces_n), force_n)
                asked[finger, press.number] = face.force_n(step)
