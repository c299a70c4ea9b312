"""Guides a person, or a scenario, through presses on a board."""

from __future__ import annotations

from typing import Protocol

from ...hand.hand import Hand
from .detector import Press, PressStep, Procedure
from .force_source import ForceSource, rows_of


class Prompt(Protocol):
    """The user interface of a guided procedure."""

    def show(self, step: PressStep | None) -> None:
        """Show the next thing to do; None when all is done."""

    def force_n(self, step: PressStep) -> float:
        """The force in N at the press just held, as a scale shows it; asked only without a reference."""


def guide(
    hand: Hand,
    procedure: Procedure,
    reference: ForceSource | None,
    prompt: Prompt | None,
) -> dict[int, list[Press]]:
    """Feed ``procedure`` with the stream of ``hand`` until it is done; the presses by finger, each with a force.

    The force is the ``reference``'s, or the ``prompt``'s; a scenario, which presses by itself, needs no prompt.
    Starts the stream if necessary, and does not stop it. Raises InputError when a finger waits too long, or a simulated
    source ends first.
    """
    forces_n: list[float] = []

    def show(step: PressStep | None) -> None:
        if prompt is not None:
            if reference is None:
                ask_forces(procedure, forces_n, prompt)
            prompt.show(step)

    shown = procedure.step
    show(shown)
    for batch in hand.batches():
        rows = rows_of(batch.wire, batch.t_us, reference)
        for k in range(len(rows)):  # one by one: a batch may hold more than one step
            procedure.feed(rows[k : k + 1])
            if procedure.step != shown:
                shown = procedure.step
                show(shown)
        if procedure.done:
            break
    return procedure.finish(forces_n)


def ask_forces(procedure: Procedure, forces_n: list[float], prompt: Prompt) -> None:
    """Ask for the force of every press without one: several, when somebody presses faster than they type."""
    forces_n += [prompt.force_n(step) for _, step in procedure.asked()[len(forces_n) :]]
