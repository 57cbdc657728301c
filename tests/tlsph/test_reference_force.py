"""One whole force evaluation against the slow reference in numpy, in 2-D and 3-D, with every option."""

import numpy as np
import pytest
from reference_sph import Options, reference_of
from solids import ONE_BRANCH, SOFT, THREE_BRANCHES, evaluate, set_random_state, simulation, strains, supports, tables

ROLLERS = {
    2: {"X0": (0.0, "roller"), "Y0": (0.0, "roller")},
    3: {"X0": (0.0, "roller"), "Y0": (0.0, "roller"), "Z1": (1.0, "roller")},
}
PARTICLES = {2: (6, 5), 3: (4, 5, 4)}


def planes_of(named: dict) -> list:
    """(axis, coordinate, kind) for the reference."""
    return [("XYZ".index(key[0]), place, kind) for key, (place, kind) in named.items()]


def built(dimension, material, method=None, planes=None, body=None, smoothing=1.05):
    """A body of unequal spacings, its inside unevenly filled, in a random state."""
    upper = [1.0, 1.3, 0.9][:dimension]
    planes = {
        key: (upper["XYZ".index(key[0])] if place else 0.0, kind) for key, (place, kind) in (planes or {}).items()
    }
    data = tables(
        PARTICLES[dimension],
        upper,
        material={**SOFT, **material},
        method={"smoothing": smoothing, **(method or {})},
        body={"jitter": 0.25, **(body or {})},
        boundaries=supports(**planes),
    )
    sim = simulation(data)
    set_random_state(sim, consistent=False)
    return sim, planes_of(planes)


def differences(sim, planes, **options) -> dict[str, float]:
    """Largest differences from the reference, relative to the largest value."""
    method = sim.scene.method
    given = Options(dissipation=method.dissipation_of("kernel"), reconstruct=method.reconstruction, **options)
    d, found, wanted = sim.systems[0].dimension, evaluate(sim), reference_of(sim, strains(sim), planes, given)
    pairs = {
        "gradient": (found["gradient"], wanted.gradient[:, :d, :d]),
        "stress": (found["PL"], (wanted.P @ wanted.L)[:, :d, :d]),
        "T": (found["T"], wanted.T[:, :d]),
        "D": (found["D"], wanted.D[:, :d]),
    }
    return {name: np.abs(a - b).max() / max(np.abs(b).max(), 1e-300) for name, (a, b) in pairs.items()}


def agrees(sim, planes, **options) -> None:
    found = differences(sim, planes, **options)
    assert max(found.values()) < 1e-12, found


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(
    "material", [{}, {"branches": ONE_BRANCH}, {"zeta": 0.2, "branches": THREE_BRANCHES}], ids=["0", "1", "zeta-3"]
)
@pytest.mark.parametrize("mirrored", [False, True], ids=["free", "mirror"])
def test_a_force_evaluation_is_that_of_the_paper(dimension, material, mirrored):
    agrees(*built(dimension, material, planes=ROLLERS[dimension] if mirrored else None))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("kind", ["fixed", "antisymmetric"])
def test_walls_that_hold_tangentially(dimension, kind):
    agrees(*built(dimension, {"branches": ONE_BRANCH}, planes={"Y0": (0.0, kind), "X0": (0.0, "roller")}))


@pytest.mark.parametrize("dimension", [2, 3])
def test_without_reconstruction(dimension):
    agrees(*built(dimension, {"branches": ONE_BRANCH}, {"reconstruction": False}, ROLLERS[dimension]))


@pytest.mark.parametrize("dimension", [2, 3])
def test_without_dissipation(dimension):
    sim, planes = built(dimension, {"branches": ONE_BRANCH}, {"dissipation": 0.0}, ROLLERS[dimension])
    found = differences(sim, planes)
    assert max(found[name] for name in ("gradient", "stress", "T")) < 1e-12
    assert not evaluate(sim)["D"].any()


def test_a_factor_scales_the_dissipation():
    sim, planes = built(2, {"branches": ONE_BRANCH}, {"dissipation": 0.3})
    agrees(sim, planes)
    full, _ = built(2, {"branches": ONE_BRANCH})
    np.testing.assert_allclose(evaluate(sim)["D"], 0.3 * evaluate(full)["D"], rtol=1e-12, atol=1e-14)


def shell(dimension: int, planes: dict, body=None):
    """A sector of a thick ring or tube, whose particles have their own axes."""
    shape = {"radius": 1.0, "thickness": 0.5, "angles": [0.0, 90.0]}
    shape |= {"centre": [0.0, 0.0]} if dimension == 2 else {"base": [0.0, 0.0, 0.0], "axis": "Y", "length": 0.6}
    particles = [5, 3] if dimension == 2 else [5, 3, 3]
    data = tables(
        particles, material={**SOFT, "branches": ONE_BRANCH}, method={"smoothing": 1.05}, boundaries=supports(**planes)
    )
    data["bodies"][0] |= {"shape": {"cylindrical_shell": shape}, **(body or {})}
    sim = simulation(data)
    set_random_state(sim, consistent=False)
    return sim, planes_of(planes)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("mirrored", [False, True], ids=["free", "mirror"])
def test_particles_with_their_own_axes(dimension, mirrored):
    planes = {2: {"X0": (0.0, "roller"), "Y0": (0.0, "roller")}, 3: {"X0": (0.0, "roller"), "Z0": (0.0, "roller")}}
    agrees(*shell(dimension, planes[dimension] if mirrored else {}))


def test_two_materials_in_contact():
    data = tables(
        (3, 5),
        [1.0, 1.0],
        material={**SOFT, "branches": ONE_BRANCH},
        method={"smoothing": 1.05},
        body={"placement": "cells"},
    )
    other = {**data["bodies"][0], "shape": {"box": {"lower": [1.0, 0.0], "upper": [2.0, 1.0]}}}
    data["bodies"].append({**other, "material": {**SOFT, "density": 4.0, "youngs_modulus": 20.0}})
    sim = simulation(data | {"bond": [{"bodies": "all"}]})
    set_random_state(sim, consistent=False)
    # neither block fills its last four lanes
    assert [(block.first, block.last) for block in sim.systems[0].blocks] == [(0, 15), (15, 30)]
    agrees(sim, [])


@pytest.mark.parametrize("strain, bound, with_direction", [(0.02, 1e-4, 1e-3), (0.15, 5e-3, 1e-2)])
def test_how_far_the_average_of_squares_is_from_the_average_of_the_paper(strain, bound, with_direction):
    """The solver takes sqrt((Z_a^2 + Z_b^2)/2) along g/|g| for (Z_a + Z_b)/2 along C_skew.

    a difference of second order.
    """
    sim, planes = built(2, {"branches": ONE_BRANCH}, planes=ROLLERS[2])
    set_random_state(sim, strain)
    of_weight = differences(sim, planes, average="mean")
    of_skew = differences(sim, planes, average="mean", direction="skew")
    assert of_weight["T"] < 1e-12
    assert 1e-6 < of_weight["D"] < bound and of_skew["D"] < with_direction
