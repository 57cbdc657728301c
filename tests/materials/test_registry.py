"""What the registry finds, and what holds for every hyperelastic law in it and in examples/: stress, objectivity,
moduli, waves.
"""

from pathlib import Path

import numpy as np
import pytest

from parsolid.materials import registry
from parsolid.materials.declaration import ROLES, parameters_of
from parsolid.materials.hyperelastic import acoustics, evaluation
from parsolid.materials.hyperelastic import functions as laws
from parsolid.scene import load_scene, parse_scene
from parsolid.simulation.loop import Simulation

DEMIRAY = f"{Path(__file__).parents[2] / 'examples' / 'demiray.py'}:Demiray"
# materials of the kinds that are compiled for every method; others are in test_isochoric_laws.py
STATED = {
    "mooney-rivlin": {"kind": "mooney-rivlin", "xi": 3e5, "zeta": 2e5, "lambda_hat": 4e6},
    "neo-hookean": {"kind": "neo-hookean", "youngs_modulus": 1e6, "poissons_ratio": 0.4},
    "demiray (a file)": {"law": DEMIRAY, "shear_modulus": 1e6, "exponent": 0.2, "volume_modulus": 5e6},
}
BRANCHES = [{"beta": 0.7, "tau": 0.02}]
METHODS = {
    "tlsph": {"kind": "tlsph"},
    "peridynamics": {"kind": "peridynamics"},
    "mpm": {"kind": "mpm", "cell": 0.25},
}


def scene_of(material: str, method: str = "tlsph", **more):
    body = {
        "shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}},
        "particles": [8, 8],
        "placement": "cells" if method == "mpm" else "vertices",
        "velocity": ["2*Y", "0.5*X*X"],
        "material": STATED[material] | {"density": 1000.0} | more,
    }
    tables = {"dimension": 2, "end_time": 1.0, "method": METHODS[method], "bodies": [body]}
    return parse_scene(tables, trust_code=True)


@pytest.fixture(params=STATED)
def law(request):
    return registry.law_of(scene_of(request.param, branches=BRANCHES).bodies[0].material)


def gradients(seed: int = 5) -> np.ndarray:
    F = np.eye(3) + 0.25 * np.random.default_rng(seed).standard_normal((12, 3, 3))
    return F[np.linalg.det(F) > 0.3]


def test_every_declared_parameter_of_every_law_has_a_unit_and_every_kind_a_table():
    for role in ROLES:
        assert registry.kinds(role)
        for kind in registry.kinds(role):
            declared = registry.declared(role, kind)
            assert (declared.role, declared.kind) == (role, kind) and declared.__doc__
            assert all(getattr(parameter, "unit", "1") for _, parameter in parameters_of(declared).values())


def test_the_stress_is_the_derivative_of_the_energy(law):
    """Without branches by central differences of W, with them of W_alpha = mu_alpha/2 (C : A - ln J^2), too."""
    elastic, F = law._replace(branch_moduli=None, relaxation_times=None), gradients()
    A = np.array([[1.2, 0.1, 0.0], [0.1, 0.9, 0.2], [0.0, 0.2, 1.1]])
    viscous = law.branch_moduli[0] * A

    def stored(F):
        C = np.swapaxes(F, -1, -2) @ F
        return evaluation.energies(law, F) + 0.5 * law.branch_moduli[0] * (
            np.einsum("...ij,ij->...", C, A) - 2.0 * np.log(np.linalg.det(F))
        )

    step, cases = (
        1e-6,
        ((elastic, None, lambda F: evaluation.energies(elastic, F)), (law, np.broadcast_to(viscous, F.shape), stored)),
    )
    for one, branch_sum, energy in cases:
        P, slope = evaluation.stresses(one, F, branch_sum), np.empty_like(F)
        for i, j in np.ndindex(3, 3):
            change = np.zeros((3, 3))
            change[i, j] = step
            slope[:, i, j] = (energy(F + change) - energy(F - change)) / (2.0 * step)
        assert P == pytest.approx(slope, rel=1e-7, abs=1e-7 * np.abs(P).max())


def test_the_law_is_objective_and_has_no_stress_at_rest(law):
    elastic, F = law._replace(branch_moduli=None, relaxation_times=None), gradients()
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    assert evaluation.energies(elastic, turn @ F) == pytest.approx(evaluation.energies(elastic, F), rel=1e-12)
    P = evaluation.stresses(elastic, F)
    assert evaluation.stresses(elastic, turn @ F) == pytest.approx(turn @ P, rel=1e-11, abs=1e-11 * np.abs(P).max())
    shear = laws.elastic_moduli(elastic)[0]
    assert np.abs(evaluation.stresses(elastic, np.eye(3)[None])).max() < 1e-13 * shear
    assert np.abs(evaluation.energies(elastic, np.eye(3)[None])).max() < 1e-13 * shear


def test_moduli_are_the_slopes_of_the_stress_at_rest(law):
    elastic, step = law._replace(branch_moduli=None, relaxation_times=None), 1e-5

    def slope(i, j, k, m):
        change = np.zeros((1, 3, 3))
        change[0, k, m] = step
        return (evaluation.stresses(elastic, np.eye(3) + change) - evaluation.stresses(elastic, np.eye(3) - change))[
            0, i, j
        ] / (2.0 * step)

    shear, lame = laws.elastic_moduli(elastic)
    assert slope(0, 1, 0, 1) == pytest.approx(shear, rel=1e-7)
    assert slope(0, 0, 1, 1) == pytest.approx(lame, rel=1e-7)
    assert slope(0, 0, 0, 0) == pytest.approx(lame + 2.0 * shear, rel=1e-7)


def test_no_wave_is_faster_than_the_wave_tensor_says(law):
    """The greatest eigenvalue of the acoustic tensor N . dP/dF . N, by differences, against N . Q N; equal at rest of a
    law with a formula of its own."""
    F = np.concatenate([np.eye(3)[None], gradients()])
    viscous = np.broadcast_to(law.branch_moduli[0] * np.eye(3), F.shape)
    Q = evaluation.states(law, F, viscous)[1]
    for N in np.linalg.qr(np.random.default_rng(8).standard_normal((3, 3)))[0]:
        step, acoustic = 1e-6, np.empty_like(F)
        for k in range(3):
            change = step * np.outer(np.eye(3)[k], N)
            acoustic[:, :, k] = (
                (evaluation.stresses(law, F + change, viscous) - evaluation.stresses(law, F - change, viscous))
                @ N
                / (2.0 * step)
            )
        fastest, bound = np.linalg.eigvalsh(acoustic)[:, -1], np.einsum("i,nij,j->n", N, Q, N)
        assert (fastest <= bound * (1.0 + 1e-6)).all()
        if laws.pressure_waves.has(type(law)):
            assert fastest[0] == pytest.approx(bound[0], rel=1e-6)
        assert acoustics.wave_moduli(law, F, N, viscous)[:, -1] == pytest.approx(fastest, rel=1e-6)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("material", STATED)
def test_every_law_runs_with_every_method_that_takes_its_role(comm, material, method):
    scene = scene_of(material, method)
    assert "hyperelastic" in scene.method.materials
    simulation = Simulation(comm, scene)
    system = simulation.systems[0]
    before = sum(system.energies())
    for _ in range(5):
        assert simulation.take_step(0.3 * comm.allreduce(system.stable_step(), min)) is not False
    kinetic, stored = system.energies()
    assert stored > 0.0 and comm.allreduce(kinetic + stored) == pytest.approx(comm.allreduce(before), rel=0.05)


def test_entry_points_are_found_by_role_and_kind(monkeypatch):
    class Point:
        name = "hyperelastic.elsewhere"

        @staticmethod
        def load():
            return registry.loaded(*DEMIRAY.rsplit(":", 1))

    scene_of("demiray (a file)")
    monkeypatch.setattr(registry, "entry_points", lambda group: [Point] if group == "parsolid.laws" else [])
    registry._installed.cache_clear()
    try:
        assert "elsewhere" in registry.kinds("hyperelastic")
        assert registry.declared("hyperelastic", "elsewhere").__qualname__.endswith("Demiray")
    finally:
        registry._installed.cache_clear()


def test_no_scene_is_imported_with_numba(tmp_path):
    """Start-up: the tables of laws are made when a scene asks for them."""
    import subprocess
    import sys

    code = "import sys, parsolid.scene; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
    assert load_scene is not None
