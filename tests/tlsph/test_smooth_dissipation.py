"""Boxes dissipate less where motion is smooth and small, unless the scene states `dissipation`."""

import pytest

import parsolid

ALTERNATING = "cos(pi*8*X)*cos(pi*8*Y)"
SMOOTH = "sin(pi*X)*sin(pi*Y)"


def dissipated(tmp_path, velocity, speed, **method):
    """What pairs of a box of 9 x 9 nodes take [J] in its first steps, over their first kinetic energy."""
    scene = {
        "title": "a box",
        "dimension": 2,
        "end_time": 0.05,
        "method": {"kind": "tlsph", "weights": "fourth-order"} | method,
        "bodies": [
            {
                "shape": {"box": {"lower": [0, 0], "upper": [1, 1]}},
                "particles": [9, 9],
                "velocity": [f"{speed}*{velocity}", "0"],
                "material": {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3},
            }
        ],
        "output": {"fields_times": [], "pictures": False, "history_steps": 1},
    }
    history = parsolid.run(scene, output=tmp_path / f"{velocity[:3]}{speed}{len(method)}").history
    return history["numerical_dissipation"].iloc[-1] / history["kinetic"].iloc[0]


@pytest.mark.parametrize(
    ("velocity", "speed", "share"), [(ALTERNATING, 1e-6, 1.0), (SMOOTH, 1e-6, 0.1), (SMOOTH, 0.3, 1.0)]
)
def test_smooth_small_motion_is_damped_a_tenth(tmp_path, velocity, speed, share):
    least = dissipated(tmp_path, velocity, speed)
    assert least == pytest.approx(share * dissipated(tmp_path, velocity, speed, dissipation=1.0), rel=0.15)
