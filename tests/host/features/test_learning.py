"""Levenberg-Marquardt against scipy and finite differences; what is learnt against data whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from biotac.errors import InputError
from biotac.features import edge, force, inputs, levenberg, roc
from biotac.features.levenberg import _forward, squared_jacobian, train
from biotac.sim.physics import Finger
from biotac.sim.stimulations import press_bars, stimulate


def layers(w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights (4, 5) and (6, 2) of a net of three inputs, five units and two outputs."""
    return w[:20].reshape(4, 5), w[20:].reshape(6, 2)


@pytest.fixture(scope="module")
def small() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    x = rng.normal(size=(60, 3))
    t = np.column_stack([np.sin(x[:, 0]) + x[:, 1], x[:, 2] * 0.5 - x[:, 0]]) + rng.normal(0.0, 0.05, (60, 2))
    return x, t, rng.normal(0.0, 0.5, 32)


def test_the_squared_jacobian_is_that_of_finite_differences(small) -> None:
    x, t, w = small

    def error(at: np.ndarray) -> np.ndarray:
        return (_forward(x, *layers(at))[1] - t).ravel()

    step = 1e-6
    each = np.column_stack([(error(w + step * one) - error(w - step * one)) / (2 * step) for one in np.eye(32)])
    jj, je, squares = squared_jacobian(x, t, *layers(w))
    np.testing.assert_allclose(jj, each.T @ each, atol=1e-6)
    np.testing.assert_allclose(je, each.T @ error(w), atol=1e-6)
    assert squares == pytest.approx((error(w) ** 2).sum())


def test_it_comes_as_low_as_scipy_s_on_the_cost_it_ends_with(small) -> None:
    """scipy's own Levenberg-Marquardt, started where ours ended, on beta e'e + alpha w'w, finds little left."""
    x, t, _ = small
    net = train(x, t, units=5, steps=200, seed=3)
    scaled_x, scaled_t = (x - net.mean) / net.scale, (t - net.target_mean) / net.target_scale
    w = np.concatenate([net.hidden.ravel(), net.output.ravel()])
    data = ((_forward(scaled_x, *layers(w))[1] - scaled_t) ** 2).sum()
    alpha, beta = net.gamma / (2 * (w @ w)), (t.size - net.gamma) / (2 * data)  # MacKay's fixed point

    def residuals(at: np.ndarray) -> np.ndarray:
        error = (_forward(scaled_x, *layers(at))[1] - scaled_t).ravel()
        return np.concatenate([np.sqrt(beta) * error, np.sqrt(alpha) * at])

    theirs = least_squares(residuals, w, method="lm")
    assert (residuals(w) ** 2).sum() <= 1.01 * 2 * theirs.cost


def test_evidence_switches_off_what_the_data_does_not_determine() -> None:
    rng = np.random.default_rng(2)
    x = rng.normal(size=(300, 4))
    line = x[:, :1] * 2.0 + 1.0
    of_line = train(x, line + rng.normal(0.0, 0.1, line.shape), units=10, steps=60)
    of_noise = train(x, rng.normal(size=line.shape), units=10, steps=60)
    assert of_line.gamma < 0.7 * of_line.weights
    assert np.sqrt(((of_line(x) - line) ** 2).mean()) < 0.05, "half the noise at most is followed"
    assert of_noise(x).std() < 0.5


def test_training_stops_by_the_rows_kept_aside_and_refuses_nonsense() -> None:
    rng = np.random.default_rng(4)
    x, t = rng.normal(size=(40, 5)), rng.normal(size=(40, 1))
    net = train(x, t, (rng.normal(size=(40, 5)), rng.normal(size=(40, 1))), units=10, steps=60)
    assert net.steps < 60
    with pytest.raises(InputError, match=r"inputs \(40, 5\) and targets \(39, 1\): expected"):
        train(x, t[:-1])
    x[3, 2] = np.nan
    with pytest.raises(InputError, match="contain NaN or infinity: expected finite numbers"):
        train(x, t)
    assert np.isnan(net(x)).any(axis=1).nonzero()[0].tolist() == [3]
    with pytest.raises(InputError, match=r"expected \(n, 5\), as in training"):
        net(x[:, :4])


def test_reductions_keep_what_they_say() -> None:
    rng = np.random.default_rng(5)
    source = rng.uniform(-1.0, 1.0, (2000, 2))
    columns = np.column_stack([source @ [[1.0, 0.4, 0.1], [0.2, 1.0, -0.6]], rng.normal(0.0, 1e-3, 2000)])
    assert inputs.principal(columns[:, :3]).matrix.shape == (3, 2), "the third is the first two's"
    ours = inputs.independent(columns[:, :3])(columns[:, :3])
    alike = np.abs(np.corrcoef(np.hstack([ours, source]).T)[:2, 2:])
    assert alike.max(axis=1).min() > 0.98
    follows = np.column_stack([source[:, 0], source[:, 0] ** 3, rng.normal(size=2000)])
    kept = inputs.correlated(columns, follows)
    assert kept[0, :2].all() and not kept[3].any()
    assert inputs.only(columns, kept[:, 0])(columns).shape == (2000, kept[:, 0].sum())


def test_splits_keep_groups_whole_and_the_paper_s_shares() -> None:
    groups = np.repeat(np.arange(200), 7)
    parts = roc.split(groups, seed=1)
    assert np.sum(parts, axis=0).tolist() == [1] * len(groups)
    assert [len(np.unique(groups[part])) for part in parts] == [140, 30, 30]
    assert sum(len(set(groups[a]) & set(groups[b])) for a, b in ((parts[0], parts[1]), (parts[0], parts[2]))) == 0


def test_confusion_and_deciding_together() -> None:
    said, truth = np.array([0, 1, 1, 3]), np.array([0, 0, 1, 3])
    table = roc.confusion(said, truth, 4)
    assert table[1, 0] == 1 and table.trace() == 3 and table.sum() == 4


def test_a_trajectory_is_read_at_shares_of_its_own_largest_signal() -> None:
    its = stimulate(Finger(1), (2, 2, 1, 1), seed=1, frames=9)
    above = its.counts - its.tare
    found, press = roc.trajectories(above, its.tare, its.stimulation)
    assert found.shape == (30, 3 * 17) and press.tolist() == list(range(30))
    rows = roc.shape(above, its.tare)
    assert any((found[4, -17:] == row).all() for row in rows[its.stimulation == 4]), "the last is a row of the press"
    np.testing.assert_allclose(found[:, 34 + 2], [rows[its.stimulation == k, 2].max() for k in range(30)])
    with pytest.raises(InputError, match="rows of a press are not consecutive"):
        roc.trajectories(above, its.tare, np.arange(len(its)) % 7)


def test_four_probes_are_told_apart_where_places_are_many() -> None:
    """Chance is a quarter; few places and steps, because this is a test by day. The experiment has the figures."""
    its = stimulate(Finger(1), (40, 40, 40, 40), seed=2, frames=5)
    columns, press = roc.trajectories(its.counts - its.tare, its.tare, its.stimulation)
    first = np.searchsorted(its.stimulation, press)
    kind, contact = its.probe[first], its.contact[first]
    training, stopping, test = roc.split(contact, 1)
    classifier = roc.train(columns[:, 34:], kind, training, stopping, steps=8)
    alone = (classifier(columns[test][:, 34:]) == kind[test]).mean()
    together = (classifier(columns[test][:, 34:], contact[test]) == kind[test]).mean()
    assert alone > 0.5 and together > alone
    outputs = roc.machine().fit(columns[~test], kind[~test]).decision_function(columns[test])
    assert (roc.decide(outputs) == kind[test]).mean() > alone
    assert (roc.decide(outputs, contact[test]) == kind[test]).mean() >= together


def test_force_by_nets_of_classes_and_of_one() -> None:
    rng = np.random.default_rng(6)
    x = rng.normal(size=(400, 6))
    kind = (np.arange(400) % 2).astype(np.int64)
    truth = np.where(kind[:, None] == 0, x[:, :3], -x[:, :3])  # no single map can do that
    groups = np.arange(400) // 20

    def held_out(kinds: np.ndarray | None) -> np.ndarray:
        def predict(training: np.ndarray, test: np.ndarray) -> np.ndarray:
            of = None if kinds is None else kinds[training]
            nets = force.train(x[training], truth[training], groups[training], of, steps=15)
            return nets(x[test], None if kinds is None else kinds[test])

        return force.cross_validated(x, groups, 2, predict)

    one, two = (np.sqrt(((held_out(kinds) - truth) ** 2).mean()) for kinds in (None, kind))
    assert two < 0.2 < 0.9 < one
    nets = force.train(x[:200], truth[:200], groups[:200], by_spearman=True, steps=1)
    assert nets(x).shape == (400, 3)
    with pytest.raises(InputError, match=r"class 1 has no net: expected one of \[0\]"):
        nets(x, kind)


def test_classes_of_the_paper() -> None:
    d, large = np.array([13.9, 14.0, 3.0, 20.0]), np.array([False, False, True, True])
    assert [force.CLASSES[c] for c in force.classes(d, large)] == [
        "rear, small", "forward, small", "rear, large", "forward, large",
    ]  # fmt: skip


def test_directions_of_edges() -> None:
    assert np.degrees(edge.turn(np.radians([179.0, 10.0]), np.radians([1.0, 100.0]))) == pytest.approx([-2.0, -90.0])
    counts, tare, angle = press_bars(Finger(1), 400, seed=1)
    seen = edge.columns(counts - tare, tare)
    assert seen.shape == (400, 57) and angle.min() >= 0.0 and angle.max() < np.pi
    net = edge.train(seen[:340], angle[:340], steps=5)
    off = np.degrees(edge.turn(net(seen[340:]), angle[340:]))
    assert np.median(np.abs(off)) < 22.5, "half of what guessing gives; the experiment trains on more"
    assert levenberg.PATIENCE == 5
