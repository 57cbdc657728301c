"""The table of laws and methods: each hyperelastic law, flow stress and kinematic hardening of the registry and of the
files in `examples`, with constants made from what it declares. A law that is added is tried here without a change.

One kernel of each hyperelastic law is compiled; runs in the methods are in plain Python.
"""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from materials.deformations import arguments, assert_derived_from_energy, deformations, energy, stress, tangent_of
from materials.test_total_lagrangian import Point
from mpi4py import MPI
from solids import LINEAR_COPPER, Record

from parsolid.materials import registry
from parsolid.materials.declaration import NEEDED, Direction, OfParticle, Parameter, parameters_of
from parsolid.materials.hyperelastic import evaluation
from parsolid.materials.hyperelastic import functions as of
from parsolid.materials.hyperelastic.at_particles import after_step, at_particle
from parsolid.materials.plastic import tile_update as update
from parsolid.materials.plastic.functions import flow_stress
from parsolid.materials.viscoelastic.maxwell import branch_stress
from parsolid.observables.declared import Observables
from parsolid.scene import parse_scene
from parsolid.scene.methods import SETTINGS
from parsolid.scene.plasticity import library
from parsolid.simulation.loop import RunFailed, Simulation

TESTS = Path(__file__).parents[1]
# where constants made from declarations would not be those of a solid, or not of all of it
STATED = {
    "formula": {
        "energy": "mu*(lambda1bar**3 + lambda2bar**3 + lambda3bar**3 - 3) + mu*(I1bar - 3) + K/2*(J - 1)**2",
        "constants": {"mu": 2e5, "K": 2e7},
    },
    "gasser-ogden-holzapfel": {"softening": {"r": 2.0, "m": 1e5, "beta": 0.05}},
    "gent": {"limit": 90.0},
    "mazars": {"tensile_strength": 1e4, "fracture_energy": 5e3},
    "ogden": {"mu_2": -0.01e6, "alpha_2": -2.0},
    "polynomial": {"c10": 0.15e6, "c01": 0.02e6, "c11": 2e3, "c20": 1e3, "c02": 0.0, "c30": 0.0},
    "yeoh": {"c2": -1.5e3, "c3": 50.0},
}
# F of a uniform strain; of flow the rate of F [1/s], the step [s] and how many there are
STRAINED = np.array([[1.15, 0.1, 0.0], [0.08, 0.95, 0.0], [0.0, 0.0, 1.0]])
# stretches of extreme strain; laws with a limit, beyond which a stress is none that a run bears [Pa]
EXTREME = [(30.0, 0.2, 1.0 / 6.0), (30.0, 1.0, 1.0), (0.01, 1.0, 1.0), (30.0, 30.0, 0.01)]
LIMITED, UNBEARABLE = ("demiray", "gasser-ogden-holzapfel", "gent", "guccione", "holzapfel-gasser-ogden"), 1e24
FLOW, STEP, STEPS = np.array([[3e3, 2e3], [0.5e3, -2e3]]), 4e-7, 10
FLOWING = "flow-stress", "kinematic-hardening"
OF_HYPERELASTIC = [kind for kind, one in SETTINGS.items() if "hyperelastic" in one.materials]
BRANCH = {"branches": [{"modulus": 5e5, "tau": 0.02}]}


@cache
def of_files(role: str) -> dict[str, str]:
    """Kind -> file:class of the laws of a role in examples/."""
    pattern = rf'^@law\("{role}", "([a-z-]+)"\)\nclass (\w+)'
    files = sorted((TESTS.parent / "examples").glob("*.py"))
    return {kind: f"{file}:{name}" for file in files for kind, name in re.findall(pattern, file.read_text(), re.M)}


def kinds(role: str) -> list[str]:
    return [*registry.kinds(role), *of_files(role)]


def declared(role: str, kind: str):
    if kind not in of_files(role):
        return registry.declared(role, kind)
    path, name = of_files(role)[kind].rsplit(":", 1)
    return registry.from_text(path, name, Path(path).read_text())


def constants(role: str, kind: str, pressure: float) -> dict:
    """A table of a law: constants in Pa as large as the pressure, a tenth of it where they need not be stated, and
    numbers within their bounds."""
    law, table = declared(role, kind), {"law": of_files(role)[kind]} if kind in of_files(role) else {"kind": kind}
    chosen = [group[0] for group in getattr(law, "exactly_one", ())]
    for name, (plain, note) in parameters_of(law).items():
        if isinstance(note, Direction):
            table[name] = {"vector": ["1", "0.5 + X"]}
        if not isinstance(note, Parameter) or name == "density" or plain not in (float, float | None):
            continue
        needed = note.default is NEEDED or name in chosen
        least = max(bound for bound in (note.above, note.at_least, 0.0) if bound is not None)
        most = min((bound for bound in (note.below, note.at_most) if bound is not None), default=least + 4.0)
        if note.unit == "Pa" and (needed or note.default == 0.0):
            table[name] = pressure * (20.0 if name == "bulk_modulus" else 1.0 if needed else 0.1)
        elif needed:
            table[name] = 0.5 * (least + most)
    return table | STATED.get(kind, {})


def block(method: str, material: dict, size: float, boundaries=(), settings=(), **body):
    """4 x 4 particles in a square from (size, size)/2 on; settings: of the method."""
    own = {"mpm": {"cell": 0.5 * size}, "ulsph": {"viscosity": False}}
    kind = {"kind": method} | dict(settings) | own.get(method, {})
    if method == "peridynamics" and material.get("kind") == "mazars":
        kind["stabilisation"] = {"kind": "none"}
    body |= {
        "shape": {"box": {"lower": [0.5 * size] * 2, "upper": [1.5 * size] * 2}},
        "particles": [4, 4],
        "placement": "cells" if method in ("mpm", "ulsph") else "vertices",
        "material": {"density": 1000.0} | material,
    }
    tables = {"dimension": 2, "end_time": 1.0, "method": kind, "bodies": [body], "boundaries": list(boundaries)}
    return parse_scene(tables, trust_code=True)


@cache
def law_of(kind: str):
    """A hyperelastic law at a place, with the state variables of time 0."""
    material = block("tlsph", constants("hyperelastic", kind, 1e6), 1.0).bodies[0].material
    values = material.values_at(np.array([[0.7, 0.9]]), {}, np.array([1e-3]))
    return at_particle(material.build("plane-strain"), values.ravel(), 1, 0)


@pytest.mark.parametrize("kind", kinds("hyperelastic"))
def test_stress_tangent_and_waves_belong_to_the_energy(kind):
    """And nothing is left at rest, whose moduli are those that the law tells."""
    law, one = law_of(kind), np.eye(3)
    ratios = assert_derived_from_energy(law, [1.01 * one, *deformations(60, 0.2, seed=7)])
    shear, lame = of.elastic_moduli(law)
    # differences of an energy see both sides of fibres that switch at rest
    left = 1e-12 if of.stress.has(type(law)) else 1e-3
    assert np.abs(stress(law, one)).max() < left * shear and abs(energy(law, one)) < 1e-12 * shear
    if any(isinstance(note, OfParticle) for _, note in parameters_of(declared("hyperelastic", kind)).values()):
        assert np.mean(ratios) < 1.8
        return
    tangent = tangent_of(lambda F: stress(law, F), one)
    assert tangent[0, 1, 0, 1] == pytest.approx(shear, rel=1e-6)
    assert tangent[0, 0, 1, 1] == pytest.approx(lame, rel=1e-6)
    # a formula of the waves of an isotropic law is exact for equal stretches
    if of.pressure_waves.has(type(law)):
        assert ratios[:6] == pytest.approx([1.0] * 6, abs=1e-6)
        assert np.mean(ratios) < (1.2 if kind == "saint-venant-kirchhoff" else 1.06)


@pytest.mark.parametrize("kind", kinds("hyperelastic"))
@pytest.mark.parametrize("stretches", EXTREME)
def test_stress_belongs_to_the_energy_at_extreme_strain(kind, stretches):
    """At stretches of 30 and 1e-2; laws with a limit have no stress that a run bears beyond it."""
    random, law, D = np.random.default_rng(2), law_of(kind), np.diag(stretches)
    before, after = (np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(2))
    after = after * np.linalg.det(before) * np.linalg.det(after)
    P = before.T @ stress(law, before @ D @ after) @ after.T
    waves = np.array(of.pressure_waves(law, *arguments(before @ D @ after)))
    if kind in LIMITED and not np.abs(P).max() < UNBEARABLE:
        return
    assert np.isfinite(waves).all()
    largest = np.abs(P * stretches).max()
    for i, j in np.ndindex(3, 3):
        change, step = np.outer(np.eye(3)[i], np.eye(3)[j]), 1e-4 * min(stretches[i], stretches[j])
        W = [energy(law, before @ (D + n * step * change) @ after) for n in (1, -1, 2, -2)]
        slope = (8.0 * (W[0] - W[1]) - (W[2] - W[3])) / (12.0 * step)
        assert abs(P[i, j] - slope) * min(stretches[i], stretches[j]) < 1e-5 * largest, (i, j)


@pytest.mark.parametrize("kind", kinds("hyperelastic"))
def test_kernels_have_the_values_of_python(kind):
    law, F = law_of(kind), np.array(deformations(8, 0.2, seed=2))
    P, Q, _ = evaluation.states(law, F)
    W = evaluation.energies(law, F)
    # second differences of an energy lose six digits
    rounding = 1e-11 if of.pressure_waves.has(type(law)) else 1e-9
    for n, one in enumerate(F):
        np.testing.assert_allclose(P[n], stress(law, one), rtol=0.0, atol=1e-12 * np.abs(P[n]).max())
        plain = evaluation.symmetric_tensors(np.array(of.pressure_waves(law, *arguments(one))))
        np.testing.assert_allclose(Q[n], plain, rtol=0.0, atol=rounding * np.abs(plain).max())
        assert W[n] == pytest.approx(energy(law, one), rel=1e-9)


# --- in the methods -------------------------------------------------------------------------------------------------


def of_uniform_strain(method: str, kind: str) -> tuple[float, float]:
    """Largest difference from the stress of the law, over its largest component, of a block that starts with a strain,
    and of the balance of energy over what it stores, in three steps."""
    places = [f"{a!r}*X + {b!r}*Y" for a, b in (STRAINED - np.eye(3))[:2, :2].tolist()]
    table = constants("hyperelastic", kind, 1e6) | BRANCH
    scene = block(method, table, 1.0, displacement=places)
    simulation, record = Simulation(MPI.COMM_SELF, scene), Record()
    system, material = simulation.systems[0], scene.bodies[0].material
    rows = system.particles.owned_rows
    bands = rows("band").ravel() if "band" in system.particles else None
    values = material.values_at(rows("reference_position"), {}, bands)
    found, worst, F = np.reshape(Observables([system]).field("stress"), (-1, 3, 3)), 0.0, arguments(STRAINED)
    for p in range(16):
        law = after_step(at_particle(material.build("plane-strain"), values.ravel(), 16, p), *F)
        P = stress(law, STRAINED) + np.reshape(branch_stress(5e5, (5e5, 5e5, 5e5, 0.0, 0.0, 0.0), *F), (3, 3))
        expected = P @ STRAINED.T / F[2]
        worst = max(worst, np.abs(found[p] - expected).max() / np.abs(expected).max())
    record.write(simulation)
    for _ in range(3):
        assert simulation.take_step(0.3 * system.stable_step()) > 0.0
        record.write(simulation)
    columns = record.columns()
    return float(worst), float(np.abs(columns["energy_error"]).max() / columns["strain_energy"].max())


def relaxed(method: str) -> dict[str, tuple[float, float]]:
    """Of a block that starts with a strain and is held, its branch one step of 0.9 tau after another: the difference of
    the stored energy from that of the exact relaxation, and that of the balance of energy, over what it stores."""
    held = {"kind": "velocity", "box": {"lower": [-9.0] * 2, "upper": [9.0] * 2}, "velocity": ["0", "0"]}
    result, modulus, tau, steps = {}, 2e6, 1e-3, 6
    for strain in (0.01, 0.2):
        law = {"kind": "neo-hookean", "youngs_modulus": 3e6, "poissons_ratio": 0.3}
        branched = law | {"branches": [{"modulus": modulus, "tau": tau}]}
        scene = block(method, branched, 1.0, [held], displacement=[f"{strain}*X", "0"])
        simulation, record = Simulation(MPI.COMM_SELF, scene), Record()
        record.write(simulation)
        for _ in range(steps):
            simulation.take_step(0.9 * tau)
            record.write(simulation)
        F = np.diag([1.0 + strain, 1.0, 1.0])
        C = F.T @ F
        A = np.linalg.inv(C) + np.exp(-0.9 * steps) * (np.eye(3) - np.linalg.inv(C))
        W = energy(scene.bodies[0].material.build("plane-strain"), F)
        W += 0.5 * modulus * (np.trace(C @ A) - 3.0 - np.log(np.linalg.det(C @ A)))
        columns = record.columns()
        stored = columns["strain_energy"]
        error = np.abs(columns["energy_error"]).max() / stored.max()
        result[str(strain)] = float(abs(stored[-1] / W - 1.0)), float(error)
    return result


def to_limits(method: str) -> dict[str, bool]:
    """Whether a run fails that pulls a block at a rate of 1e4/s until chains or fibres are stretched out, of each law
    with such a limit."""
    pulled = {"kind": "velocity", "box": {"lower": [-90.0] * 2, "upper": [90.0] * 2}, "velocity": ["1e4*X", "0"]}
    result = {}
    for kind in LIMITED:
        law, floor = constants("hyperelastic", kind, 1e6), {"minimum_step": 1e-7}
        simulation = Simulation(MPI.COMM_SELF, block(method, law, 1.0, [pulled], floor, velocity=["1e4*X", "0"]))
        try:
            simulation.run()
            result[kind] = False
        except RunFailed:
            result[kind] = 5e-5 < simulation.clock.time < 1e-2
    return result


def metal(kind: str) -> dict:
    """A material whose flow stress is of this kind, or whose kinematic hardening is."""
    published = next((name for name, one in library().items() if one.flow_stress.kind == kind), None)
    if published is not None:
        return {"kind": "elastic-plastic", "library": published}
    role = "flow-stress" if kind in kinds("flow-stress") else "kinematic-hardening"
    return LINEAR_COPPER | {role.replace("-", "_"): constants(role, kind, 2e8)}


def flowed(method: str, material: dict, scale: float = 1.0, **body) -> Simulation:
    """A block after STEPS steps of a prescribed motion of all its particles, FLOW so many times as fast."""
    flow, step = scale * FLOW, STEP / scale
    (a, b), (c, d) = flow.tolist()
    velocity = [f"{p!r}*X + {q!r}*Y" for p, q in flow.tolist()]
    prescribed = velocity
    if method == "mpm":
        # of the present places of nodes; a step has that of its start
        t = f"(t - {step!r})"
        x, y = f"((1 + {d!r}*{t})*X - {b!r}*{t}*Y)", f"((1 + {a!r}*{t})*Y - {c!r}*{t}*X)"
        det = f"((1 + {a!r}*{t})*(1 + {d!r}*{t}) - {b * c!r}*{t}**2)"
        prescribed = [f"({p!r}*{x} + {q!r}*{y})/{det}" for p, q in flow.tolist()]
    everywhere = {"kind": "velocity", "box": {"lower": [-1.0] * 2, "upper": [1.0] * 2}, "velocity": prescribed}
    scene = block(method, material, 1e-3, [everywhere], velocity=velocity, **body)
    simulation = Simulation(MPI.COMM_SELF, scene)
    for _ in range(STEPS):
        simulation.take_step(step)
    return simulation


def of_uniform_flow(method: str, kind: str) -> tuple[float, float]:
    """Largest differences of the stress of a block whose particles all have a prescribed motion from that of a point,
    and the largest among the particles, over the largest component."""
    simulation, F = flowed(method, metal(kind)), np.eye(3)
    point = Point(registry.law_of(simulation.scene.bodies[0].material, "plane-strain"))
    for _ in range(STEPS):
        F[:2, :2] += STEP * FLOW
        point.move(F.copy(), STEP)
    if method == "tlsph":
        # shows the stress of the state, whose shear modulus is that of the pressure at its end
        point.move(F.copy(), 0.0)
    fields, warm = Observables(simulation.systems), point[update.TEMPERATURE]
    found = np.reshape(fields.field("stress"), (-1, 3, 3))
    size, start = np.abs(point.cauchy).max(), point.law.reference_temperature
    # the heat of a step is of first order, and there are ten
    assert warm == start or fields.field("temperature") - start == pytest.approx(warm - start, rel=0.2)
    return float(np.abs(found - point.cauchy).max() / size), float(np.ptp(found, axis=0).max() / size)


def of_extreme_flow(method: str) -> dict[str, tuple[float, float]]:
    """The von Mises stress of copper that flows at 4e7/s, and molten at 1e5/s, beside the flow stress [Pa] of the
    state."""
    result = {}
    for name, scale, body in (("fast", 1e4, {}), ("molten", 30.0, {"temperature": 2000.0})):
        simulation = flowed(method, metal("johnson-cook"), scale, **body)
        law = registry.law_of(simulation.scene.bodies[0].material, "plane-strain")
        fields = Observables(simulation.systems)
        strain, temperature = (np.mean(fields.field(one)) for one in ("plastic_strain", "temperature"))
        stress = np.reshape(fields.field("stress"), (-1, 3, 3)).mean(axis=0)
        s = stress - np.trace(stress) / 3.0 * np.eye(3)
        D = scale * 0.5 * (FLOW + FLOW.T)
        rate = np.sqrt(2.0 / 3.0 * (np.sum(D * D) - np.trace(D) ** 2 / 3.0))
        expected = flow_stress(law.flow_stress, strain, rate, temperature, 1e10, law.melting.temperature)
        result[name] = float(np.sqrt(1.5 * np.sum(s * s))), float(expected)
    return result


@pytest.mark.parametrize("method", OF_HYPERELASTIC)
def test_a_uniform_strain_has_the_stress_of_each_law(method, plain_python):
    for kind in kinds("hyperelastic"):
        error, balance = of_uniform_strain(method, kind)
        assert error < 1e-6 and balance < 0.05, (kind, error, balance)


@pytest.mark.parametrize("method", OF_HYPERELASTIC)
def test_a_branch_relaxes_as_the_exact_solution_of_a_strain_that_is_held(method, plain_python):
    """Of a step of 0.9 relaxation times the loss has an error of the square of the strain."""
    (small, balance), (large, large_balance) = relaxed(method).values()
    assert small < 1e-10 and large < 1e-10
    assert balance < 1e-3 and large_balance < 1.5e-2


@pytest.mark.parametrize("method", [kind for kind in OF_HYPERELASTIC if kind != "ulsph"])
def test_a_run_ends_where_a_law_has_its_limit(method, plain_python):
    """In `ulsph` neighbours are out of reach before, which a run tells."""
    assert all(to_limits(method).values())


@pytest.mark.parametrize("method", [kind for kind, one in SETTINGS.items() if "elastic-plastic" in one.materials])
def test_a_uniform_flow_has_the_stress_of_each_law(method, plain_python):
    """Methods that advance a deviator by rates leave out the pressure mu d:d of the elastic strain."""
    bound = 1e-3 if method in ("mpm", "ulsph") else 1e-6
    for kind in (kind for role in FLOWING for kind in kinds(role)):
        error, spread = of_uniform_flow(method, kind)
        assert error < bound and spread < 1e-9, (kind, error, spread)


@pytest.mark.parametrize("method", [kind for kind, one in SETTINGS.items() if "elastic-plastic" in one.materials])
def test_metal_flows_at_its_stress_at_any_rate_and_bears_no_shear_when_it_is_molten(method, plain_python):
    (fast, expected), (molten, nothing) = of_extreme_flow(method).values()
    # of the whole rate of strain in place of the plastic one
    assert fast == pytest.approx(expected, rel=5e-3) and expected > 1e8
    assert molten < 1e-6 * fast and nothing == 0.0
