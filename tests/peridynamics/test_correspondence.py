"""What the correspondence operator promises, to round-off, on jittered and partly broken bodies with mirror planes."""

import numpy as np
import pytest
from peridynamics.bonds_of_bodies import (
    PLANES,
    SOFT,
    body_of,
    gradients,
    random_field,
    scene,
    stiffness,
)
from solids import run_steps, simulation

ROUND_OFF = 1e-12
every_dimension = pytest.mark.parametrize("dimension", [1, 2, 3])
whole_or_broken = pytest.mark.parametrize("broken", [False, True], ids=["whole", "broken"])
every_support = pytest.mark.parametrize("planes", PLANES)
every_placement = pytest.mark.parametrize("placement", ["cells", "vertices"])


def skip_impossible(dimension, planes="free", broken=False):
    if dimension == 1 and (broken or planes == "corner"):
        pytest.skip("a bar has no such")


@every_dimension
@every_support
@every_placement
@whole_or_broken
def test_the_operator_is_self_adjoint(dimension, planes, placement, broken):
    skip_impossible(dimension, planes, broken)
    method = body_of(dimension, planes, placement, broken)
    u, v = random_field(method, 1), random_field(method, 2)
    Ku, Kv = stiffness(method, u), stiffness(method, v)
    scale = np.linalg.norm(u) * np.linalg.norm(Kv)
    assert abs(np.vdot(u, Kv) - np.vdot(v, Ku)) < ROUND_OFF * scale
    assert np.vdot(u, Ku) > 0.0


@every_dimension
@every_support
@every_placement
@whole_or_broken
def test_affine_fields_have_exact_gradients_and_no_control(dimension, planes, placement, broken):
    skip_impossible(dimension, planes, broken)
    method = body_of(dimension, planes, placement, broken)
    A = np.random.default_rng(9).normal(size=(dimension, dimension))
    for axis, (_, kind) in ((["X", "Y", "Z"].index(key), value) for key, value in PLANES[planes].items()):
        R = np.eye(dimension)
        R[axis, axis] = -1.0
        A = 0.5 * (A + (R if kind == "roller" else -np.eye(dimension)) @ A @ R)
    u = method.particles.owned_rows("reference_position") @ A.T
    np.testing.assert_allclose(gradients(method, u), np.broadcast_to(A, (method.owned, *A.shape)), atol=1e-11)
    controlled = stiffness(method, u)
    method.forces.controls, kept = [None], method.forces.controls
    plain = stiffness(method, u)
    method.forces.controls = kept
    assert np.abs(controlled - plain).max() < 1e-11 * np.abs(stiffness(method, random_field(method, 1))).max()


@every_dimension
@whole_or_broken
def test_a_rigid_motion_has_no_force(dimension, broken):
    skip_impossible(dimension, broken=broken)
    method = body_of(dimension, broken=broken)
    X = method.particles.owned_rows("reference_position")
    spin = np.random.default_rng(2).normal(size=(dimension, dimension))
    u = X @ (spin - spin.T).T + 0.7
    assert np.abs(stiffness(method, u)).max() < 1e-11 * np.abs(stiffness(method, random_field(method, 1))).max()


@every_dimension
@pytest.mark.parametrize("material", ["linear-elastic", "prony", "elastic-bulk"])
def test_force_is_what_the_stiffness_says(dimension, material):
    """F(u) - F(0) = -K u of the same step, with histories that are not empty."""
    law = {
        "linear-elastic": {},
        "prony": {"kind": "prony", "terms": [{"ratio": 2.0, "tau": 0.3}, {"ratio": 0.5, "tau": 0.02}]},
    }
    law["elastic-bulk"] = {**law["prony"], "bulk": "elastic"}
    plane = {"plane": "stress"} if dimension == 2 else {}
    method = body_of(dimension, "fixed", material=law[material], method=plane)
    first, u = random_field(method, 1), random_field(method, 2)
    method.operator.commit(first, 0.1)
    at_u, at_zero = np.empty_like(u), np.empty_like(u)
    method.operator.force(u, at_u, 0.05)
    method.operator.force(0.0 * u, at_zero, 0.05)
    K = stiffness(method, u, 0.05)
    np.testing.assert_allclose((at_u - at_zero) * method.operator.free, -K, atol=ROUND_OFF * 100 * np.abs(K).max())


def test_nonlinear_tangent_is_that_of_the_force():
    material = {"kind": "prony", "strain": "finite", "terms": [{"ratio": 1.0, "tau": 0.1}]}
    method = body_of(2, "fixed", material=material)
    u, du = 0.01 * random_field(method, 1), random_field(method, 2)
    tangent, ahead, behind = (np.empty_like(u) for _ in range(3))
    method.operator.linear(u, du, tangent, 0.05)
    # of fourth order, where the operator's is of second
    parts = []
    for h in (1e-4, 2e-4):
        method.operator.force(u + h * du, ahead, 0.05)
        method.operator.force(u - h * du, behind, 0.05)
        parts.append((behind - ahead) / (2.0 * h))
    expected = (4.0 * parts[0] - parts[1]) / 3.0
    np.testing.assert_allclose(tangent, expected, atol=1e-6 * np.abs(expected).max())


LAWS = {
    "relaxing": {"kind": "prony", "terms": [{"ratio": 2.0, "tau": 0.3}]},
    "elastic bulk": {
        "kind": "prony",
        "bulk": "elastic",
        "terms": [{"ratio": 1.5, "tau": 0.3}, {"ratio": 0.5, "tau": 0.06}],
    },
    "finite strain": {"kind": "prony", "strain": "finite", "terms": [{"ratio": 2.0, "tau": 0.3}]},
    "hyperelastic": {"kind": "mooney-rivlin", "zeta": 0.1, "branches": [{"beta": 2.0, "tau": 0.3}]},
}


def moving(dimension, law, **more) -> dict:
    """A smooth motion of a clamped body."""
    velocity = ["0.3*sin(2*X)", "0.2*X*X*Y", "0.1*Z*X*X"][:dimension]
    return scene(dimension, "fixed", material=LAWS[law], jitter=0.0, body={"velocity": velocity}, **more)


# in space one for all: a law is a kernel to compile
@pytest.mark.parametrize("dimension, law", [*((2, law) for law in LAWS), (3, "finite strain")])
def test_the_energy_balance_closes_with_the_square_of_the_step(dimension, law):
    worst = []
    for safety, steps in ((0.2, 30), (0.1, 60)):
        data = moving(dimension, law, method={"solution": {"kind": "explicit", "safety": safety}})
        _, columns = run_steps(data, steps)
        worst.append(np.abs(columns["energy_error"]).max() / columns["kinetic"].max())
        assert columns["material_dissipation"][-1] > 0.01 * columns["kinetic"].max()
    assert worst[0] < 5e-3
    assert worst[1] < 0.3 * worst[0]


@pytest.mark.parametrize("law", ["linear-elastic", "mooney-rivlin"])
def test_a_body_of_small_strain_that_turns_is_told(comm, law):
    """It grows by sqrt(1 + angle^2), and its energy balance knows nothing of it."""
    data = scene(2, material={**SOFT, "kind": law}, jitter=0.0, body={"velocity": ["-0.3*(Y - 0.45)", "0.3*(X - 0.5)"]})
    sim = simulation(data, comm)
    said = []
    for angle in (0.1, 0.2):
        while sim.clock.time < angle / 0.3:
            sim.take_step(sim.systems[0].stable_step())
        said.append(sim.systems[0].validity_warning())
    assert said[0] is None
    assert (said[1] is not None and "of the volume has turned" in said[1]) == (law == "linear-elastic")


@pytest.mark.parametrize(("stretch", "told"), [(3e-3, True), (0.03, False)])
def test_a_turn_that_is_half_of_the_critical_stretch_is_told(comm, stretch, told):
    """A body of small strain that turns by .06 rad grows by 1.8e-3, and breaks where its bonds bear no more."""
    body = {"velocity": ["-0.3*(Y - 0.45)", "0.3*(X - 0.5)"]}
    method = {"damage": {"critical_stretch": stretch}}
    data = scene(2, material={**SOFT, "kind": "linear-elastic"}, jitter=0.0, body=body, method=method)
    sim = simulation(data, comm)
    while sim.clock.time < 0.06 / 0.3:
        sim.take_step(0.2 * sim.systems[0].stable_step())
    assert sim.clock.step >= 20
    sim.energy_row()
    assert (sim.doubts[0] is not None) is told
    # a body that has burst shows nothing of it any more
    sim.systems[0].validity_warning = lambda: None
    assert (sim.validity_warnings()[0] is not None) is told


SPUN = {
    "hyperelastic": {"kind": "mooney-rivlin", "zeta": 0.1},
    "finite strain": {"kind": "prony", "strain": "finite"},
    "viscous": LAWS["hyperelastic"],
    "viscous, finite strain": {"kind": "prony", "strain": "finite", "terms": [{"ratio": 2.0, "tau": 0.05}]},
}


@pytest.mark.parametrize("dimension, law", [*((2, law) for law in SPUN), (3, "viscous, finite strain")])
def test_finite_strain_conserves_angular_momentum(dimension, law):
    velocity, law = ["-2*Y + 0.1*sin(9*X)", "2*X", "0.1*sin(7*Y)"][:dimension], SPUN[law]
    # branches do, where the control does not relax with them
    terms, method = law.get("terms", []), {}
    if terms or "branches" in law:
        method = {"stabilisation": {"kind": "shear-scaled", "relaxes": False}}
    material = {"terms": terms, **law} if law["kind"] == "prony" else law
    sim = simulation(scene(dimension, material=material, method=method, body={"velocity": velocity}))
    one, found = sim.systems[0], []
    for _ in range(50):
        moment = np.einsum("n,ni,nj->ij", one.mass, one.particles.owned_rows("position"), one.velocity[:, :dimension])
        found.append(moment - moment.T)
        sim.take_step(one.stable_step())
    assert np.abs(np.array(found) - found[0]).max() < ROUND_OFF * np.abs(found[0]).max()


@pytest.mark.parametrize("stretch", [0.6, 1.5, 2.0])
@pytest.mark.parametrize("law", [{"kind": "neo-hookean"}, LAWS["hyperelastic"]], ids=["elastic", "viscous"])
def test_a_released_stretch_runs_with_the_default_safety(law, stretch):
    """Stiffness grows with the stretch, and in the blow with which the free end comes back."""
    data = scene(2, "fixed", material=law, jitter=0.0, body={"displacement": [f"{stretch - 1}*X", "0"]}, end_time=1e3)
    sim, columns = run_steps(data, 150)
    assert not sim.agreement.unsound
    assert np.abs(columns["energy_error"]).max() < 0.05 * columns["strain_energy"][0]


@pytest.mark.parametrize("loads", [{}, {"loads": {"body_force": ["1", "-X"]}}], ids=["free", "loaded"])
def test_the_balance_of_one_kicked_particle_closes_to_rounding(loads):
    elastic = {"kind": "prony", "youngs_modulus": 3.0, "poissons_ratio": 0.25, "density": 1.1, "terms": []}
    solution = {"kind": "explicit", "safety": 0.8}
    data = scene(2, "fixed", material=elastic, jitter=0.0, method={"solution": solution}, **loads)
    sim = simulation(data)
    sim.systems[0].velocity[17, 0] = 1.0
    rows = [sim.energy_row()]
    for _ in range(20):
        sim.take_step(sim.systems[0].stable_step())
        rows.append(sim.energy_row())
    largest = max(row["kinetic"] for row in rows)
    assert max(abs(row["kinetic_offset"]) for row in rows) > 0.01 * largest
    assert max(abs(row["energy_error"]) for row in rows) < 1e-13 * largest


@pytest.mark.parametrize("dimension", [1, 2], ids=["bar", "plane stress"])
def test_what_relaxes_across_a_free_direction_within_a_step_is_dissipated(dimension):
    """Released from a stretch, tau << dt: the lateral strain jumps in the first step, however short that is."""
    material, worst = {**LAWS["elastic bulk"], "terms": [{"ratio": 1.5, "tau": 1e-7}, {"ratio": 0.5, "tau": 1e-7}]}, []
    for safety, steps in ((0.2, 20), (0.05, 80)):
        method = {"solution": {"kind": "explicit", "safety": safety}}
        if dimension == 2:
            method["plane"] = "stress"
        body = {"displacement": ["0.01*X", "0"][:dimension]}
        data = scene(dimension, "fixed", material=material, jitter=0.0, body=body, method=method)
        _, columns = run_steps(data, steps)
        worst.append(np.abs(columns["energy_error"]).max() / columns["strain_energy"][0])
    assert worst[1] < 4e-4 and worst[1] < 0.07 * worst[0]


@pytest.mark.parametrize("growth", [np.inf, np.nan, 1e308])
def test_a_body_that_is_crushed_beyond_bounds_has_no_stable_step(growth):
    """The run then ends with its time and place, not with an error of the program."""
    solver = simulation(scene(2, "fixed", jitter=0.0, material={"kind": "neo-hookean"})).systems[0].solver
    assert solver.stable_step() > 0.0
    solver.body.forces.tensors.growth = growth
    assert solver.stable_step() == 0.0
