"""Samplers of probes by themselves: about which axis a twist turns, and what a projection weighs with."""

from types import SimpleNamespace

import numpy as np
import pytest

from parsolid.observables.samplers import Projected
from parsolid.observables.twist import Twist

pytestmark = pytest.mark.serial


@pytest.mark.parametrize("axis", ["X", "Y", "Z", None])
@pytest.mark.parametrize("centre", [None, [1.0, 2.0, 3.0]])
def test_a_twist_is_a_right_handed_turn_about_its_axis(axis, centre):
    i, rows = "XYZ".index(axis or "Z"), np.zeros((1, 3))
    place = SimpleNamespace(value=lambda watched, field, count: rows[0] + np.array(centre or [0.0] * 3))
    twist = Twist("p", ["p.twist"], place, SimpleNamespace(axis=axis, centre=centre))
    for angle in np.linspace(0.0, 7.0, 8):
        rows[0, [i, (i + 1) % 3, (i + 2) % 3]] = 5.0, np.cos(angle), np.sin(angle)
        assert twist.values(twist.part(SimpleNamespace(dimension=3))) == pytest.approx([angle])


def test_a_projection_weighs_with_the_volume_and_the_weight():
    rows = {"reference_position": np.arange(8.0).reshape(4, 2), "volume": np.array([1.0, 2.0, 3.0, 4.0])}
    fields = {"v": np.arange(8.0).reshape(4, 2) ** 2, "s": np.arange(36.0).reshape(4, 3, 3)}
    watched = SimpleNamespace(layout=(1,), rows=rows.__getitem__, field=fields.__getitem__, dimension=2)
    weight = SimpleNamespace(evaluate=lambda places: 1.0 + places[:, 0])
    projected = Projected("p", [], weight, ["v", "s"])
    w, V = 1.0 + rows["reference_position"][:, 0], rows["volume"]
    columns = np.concatenate([fields["v"], fields["s"][:, :2, :2].reshape(4, 4)], axis=1)
    wanted = ((V * w)[:, None] * columns).sum(axis=0) / (V * w * w).sum()
    np.testing.assert_allclose(projected.values(projected.part(watched)), wanted, rtol=1e-14)
