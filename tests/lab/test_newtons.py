"""biotac-lab bench newtons: the parts of each point, on a finger with known answers."""

from pathlib import Path

import numpy as np
import pytest

from biotac_lab.bench import newtons
from biotac_lab.cli import main


def outcome() -> newtons.Outcome:
    scenes = [scene for *_, scene in newtons.UNTRAINED] + [scene for _, scene, _ in newtons.OWN_MODELS]
    points = [
        newtons.Point(
            scene,
            newtons.OWN,
            {core: found["cycles"][scene] for core, found in newtons.CORES.items()},
            {"a": [3, 0, 4]},
            800.0,
        )
        for scene in scenes
    ]
    return newtons.Outcome(points, {"a": [0.1] * 3}, {"a": [0.2] * 3}, [])


def test_every_point_has_cycles_on_every_core() -> None:
    """A scene with another name would be missing here; tests/docs/test_figures.py counts the cycles again."""
    found = outcome()
    assert {"m0plus", "m4f", "m33"} == set(newtons.CORES)
    assert all(set(point.cycles) == set(newtons.CORES) for point in found.points)
    assert found.points[0].error_n == pytest.approx(5.0)


@pytest.mark.nightly
def test_the_picture_is_drawn(tmp_path: Path) -> None:
    newtons.draw(outcome(), tmp_path / "newtons.png")
    assert (tmp_path / "newtons.png").read_bytes().startswith(b"\x89PNG")


def test_the_nearest_row_is_none_of_the_same_press() -> None:
    rng = np.random.default_rng(3)
    e = np.repeat(rng.normal(size=(30, 19)), 100, axis=0)  # thirty presses of a second
    e[2500:2600] = e[:100]  # one comes back
    rows = np.arange(0, len(e), 50)
    near, distance = newtons._nearest(e, rows)
    assert (np.abs(near - rows) >= newtons.GUARD_ROWS).all()
    again = rows < 100
    np.testing.assert_allclose(distance[again], 0.0, atol=1e-9)
    assert ((near[again] >= 2500) & (near[again] < 2600)).all()
    assert (distance[(rows >= 100) & (rows < 2500)] > 1.0).all()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["newtons"], "no recording given"),
        (["batch", "F1.npz"], "bench batch uses neither a recording nor --picture"),
        (["newtons", "/nonexistent/F1.npz"], "F1.npz"),
    ],
)
def test_what_cannot_be_measured_is_refused(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", *words]) == 2
    assert message in capsys.readouterr().err
