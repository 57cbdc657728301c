"""Probes follow their points from rank to rank, interpolate between particles, and a new one is a new file."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from solids import Record, follow, punch, simulation

from parsolid import observables
from parsolid.observables import declared
from parsolid.observables.declared import Observables
from parsolid.observables.samplers import MethodQuantity, point_among, probe_points
from parsolid.particles.container import Particles
from parsolid.particles.generated import declare_generated
from parsolid.particles.generation import generate
from parsolid.scene import SceneError, observed, parse_scene
from parsolid.simulation.history import Probes

SPEED = 200.0
# of the spinning square [kg]
MASS = 160.0


def spinning() -> dict:
    """A square of soft material points that turns on the spot."""
    material = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e7, "poissons_ratio": 0.3}
    box = {"lower": [-0.2, -0.2], "upper": [0.2, 0.2]}
    body = {"shape": {"box": box}, "spacing": [0.05], "placement": "cells", "material": material}
    return {
        "dimension": 2,
        "end_time": 1.0,
        "method": {"kind": "mpm", "cell": 0.1, "order": "usl"},
        "bodies": [body | {"velocity": [f"-{SPEED}*Y", f"{SPEED}*X"]}],
        "probes": [{"name": "corner", "at": [0.2, 0.2], "fields": ["position", "twist"]}],
    }


def sampled(data: dict, comm, steps: int, every: int = 5):
    """Columns of a run's probes every few steps, the probes, and the simulation."""
    sim, rows = simulation(data, comm), []
    probes = Probes(comm, sim.scene, Observables(sim.systems))

    def sample(sim) -> dict:
        if sim.clock.step % every == 0:
            rows.append(dict(zip(probes.columns, probes.sample())) | {"owner": owner(probes, comm)})
        return {}

    follow(sim, Record(sample), steps)
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}, probes, sim


def owner(probes: Probes, comm) -> int:
    """A number of the ranks that have particles of the first probe, 0 for a probe of all."""
    place = getattr(probes.samplers[0], "place", None)
    here = place is not None and len(place.find(probes.observables)) > 0
    return comm.allreduce(here << comm.rank)


def test_a_twist_follows_its_point_from_rank_to_rank(comm):
    many, probes, _ = sampled(spinning(), comm, 300)
    one, *_ = sampled(spinning(), comm.Split(comm.rank), 300)
    assert len(set(many.pop("owner"))) > 1 or comm.size == 1
    for name, values in many.items():
        np.testing.assert_allclose(values, one[name], rtol=0.0, atol=1e-12, err_msg=name)
    # the corner has turned more than once, always the same way, as its positions say
    assert one["corner.twist"][-1] > 2.0 * np.pi and np.all(np.diff(one["corner.twist"]) > 0.0)
    angle = np.unwrap(np.arctan2(one["corner.position_y"], one["corner.position_x"]))
    np.testing.assert_allclose(one["corner.twist"], angle - angle[0], atol=1e-12)
    # what a restart takes is the same on all ranks
    states = comm.allgather(probes.state())
    assert states == [states[0]] * comm.size
    assert states[0]["corner"][0] == pytest.approx(one["corner.twist"][-1], rel=1e-12)


def test_conditions_that_tell_their_forces_are_watched_like_probes(comm):
    data = punch((5, 5), probes=[{"name": "all", "quantity": "linear_momentum"}])
    data["boundaries"][1] |= {"name": "side", "reaction": True, "mirror": False}
    row, probes, _ = sampled(data, comm, 3, every=1)
    names = [name for name in row if name != "owner"]
    assert names == ["all.linear_momentum_x", "all.linear_momentum_y", "side.force_x", "side.force_y", "side.moment"]
    assert np.abs(row["side.force_x"]).max() > 0.0 and probes.state() == {}


def every_probe(scene: dict) -> list[dict]:
    """A probe of each quantity and of each field, at a particle, and one that is weighted, of what the method knows."""
    method = parse_scene(scene).method
    fields = [*observed.probed_fields(), *method.extra_fields]
    quantities = [*observed.QUANTITIES, *method.extra_quantities]
    # what the material has nothing of is refused
    fields = [name for name in fields if known(scene, {"at": [0.2, 0.2], "fields": [name]})]
    quantities = [name for name in quantities if known(scene, {"quantity": name})]
    probes = [{"name": f"q{i}", "quantity": name} for i, name in enumerate(quantities)]
    probes.append({"name": "corner", "at": [0.2, 0.2], "fields": fields, "centre": [0.01, 0.02]})
    return [*probes, {"name": "turn", "weight": "1 + X", "fields": [name for name in fields if name != "twist"]}]


def known(scene: dict, probe: dict) -> bool:
    try:
        return bool(parse_scene(scene | {"probes": [{"name": "one"} | probe]}).probes)
    except SceneError:
        return False


def test_every_kind_of_probe_gives_the_same_on_any_number_of_ranks(comm):
    """With particles that change their rank; what is accumulated must go with them."""
    data = spinning()
    data["probes"] = every_probe(data)
    (many, _, sim), (one, *_) = sampled(data, comm, 120), sampled(data, comm.Split(comm.rank), 120)
    assert sim.systems[0].summary()["migrated_particles"] > 0 or comm.size == 1
    assert len(many) > 60
    for name, values in one.items():
        family = [other for other in one if other.rpartition("_")[0] == name.rpartition("_")[0]]
        scale = max(np.nanmax(np.abs(one[other]), initial=0.0) for other in family if other != "owner") or 1.0
        if name != "owner":
            # momenta that add up to nothing have the rounding of their parts
            if "momentum" in name:
                scale = MASS * SPEED
            np.testing.assert_allclose(many[name], values, rtol=0.0, atol=1e-10 * max(scale, 0.01), err_msg=name)


def linear(kind: str, d: int, places: list[tuple[float, ...]], placement: str) -> dict:
    """A body of 6 x 5 (x 4) particles of unlike spacings with linear velocities and probes."""
    body = {"shape": {"box": {"lower": [0.0] * d, "upper": [0.6, 1.0, 0.2][:d]}}, "placement": placement}
    velocity = ["1 + 2*X - 3*Y", "X + Y", "5 - Z"][:d]
    if kind == "ulsph":
        flow = {"kind": "linear-hardening", "yield_stress": 1e9, "hardening": 0.0}
        material = {"kind": "elastic-plastic", "specific_heat": 1e3, "flow_stress": flow}
    else:
        material = {"kind": "neo-hookean"}
    material |= {"density": 1000.0, "youngs_modulus": 1e7, "poissons_ratio": 0.3}
    body |= {"particles": [6, 5, 4][:d], "velocity": velocity, "material": material}
    method = {"kind": kind} | ({"cell": 0.2} if kind == "mpm" else {})
    fields = ["velocity", "displacement", "pressure"]
    probes = [{"name": f"p{i}", "at": list(place), "fields": fields} for i, place in enumerate(places)]
    return {"dimension": d, "end_time": 1e-3, "method": method, "bodies": [body], "probes": probes}


PLACES = {
    2: [(0.31, 0.42), (0.6, 1.0), (0.0, 0.5), (0.25, 0.0)],
    3: [(0.6, 0.0, 0.2), (0.13, 0.77, 0.09)],
}


@pytest.mark.parametrize("kind", ["tlsph", "peridynamics", "ulsph", "mpm"])
@pytest.mark.parametrize("d", PLACES)
def test_linear_fields_are_exact_anywhere_in_a_body_and_at_its_surface(kind, d, comm):
    data = linear(kind, d, PLACES[d], "vertices" if kind in ("tlsph", "peridynamics") else "cells")
    sim = simulation(data, comm)
    probes = Probes(comm, sim.scene, Observables(sim.systems))
    found = dict(zip(probes.columns, probes.sample()))
    for i, place in enumerate(PLACES[d]):
        x, y, z = (*place, 0.0)[:3]
        for axis, value in zip("xyz"[:d], (1 + 2 * x - 3 * y, x + y, 5 - z)):
            assert found[f"p{i}.velocity_{axis}"] == pytest.approx(value, rel=1e-11, abs=1e-11)
            assert found[f"p{i}.displacement_{axis}"] == 0.0
        assert found[f"p{i}.pressure"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("y", "speed"), [(0.51, 1.0), (0.49, -1.0)])
def test_a_probe_beside_a_crack_has_the_motion_of_its_side(y, speed, comm):
    data = linear("peridynamics", 2, [(0.33, y)], "cells")
    data["method"]["pre_cracks"] = [{"segment": [[0.0, 0.5], [0.45, 0.5]]}]
    data["bodies"][0] |= {"particles": [6, 10], "velocity": ["0", "where(Y > 0.5, 1, -1)*(1 + X)"]}
    sim = simulation(data, comm)
    probes = Probes(comm, sim.scene, Observables(sim.systems))
    assert dict(zip(probes.columns, probes.sample()))["p0.velocity_y"] == pytest.approx(speed * 1.33, rel=1e-11)


def test_fields_beside_motion_have_no_new_extremes_at_a_surface():
    apart = np.stack(np.meshgrid([0.5, 1.5, 2.5], [0.5, 1.5, 2.5], indexing="ij"), axis=-1).reshape(-1, 2)
    near = [(i, tuple(one)) for i, one in enumerate(apart) if np.hypot(*one) < 1.75]
    place = point_among(near)
    assert place.continued @ apart[place.identifiers, 0] == pytest.approx(0.0, abs=1e-14)
    assert place.continued.sum() == pytest.approx(1.0) and place.bounded.tolist() == [1.0, 0.0, 0.0]
    # between particles both are the same, and a point on a particle has this one alone
    inside = point_among([(i, tuple(one - [1.2, 1.3])) for i, one in enumerate(apart)])
    np.testing.assert_allclose(inside.continued, inside.bounded, atol=1e-15)
    on_one = point_among([(i, tuple(one - apart[4])) for i, one in enumerate(apart)])
    assert on_one.identifiers.tolist() == [4] and on_one.continued.tolist() == [1.0]


NEW_QUANTITY = """
import numpy as np
from parsolid.observables.declared import Sampler, quantity

@quantity("farthest_particle")
class FarthestParticle(Sampler):
    reduction = "maximum"

    def part(self, watched):
        return np.array([np.linalg.norm(watched.rows("position"), axis=1).max(initial=0.0)])
"""
NEW_FIELD = """
from parsolid.observables.declared import field

@field
def kinetic_energy_density(rows):
    return 0.5 * rows("density") * (rows("velocity") ** 2).sum(axis=1)
"""


@pytest.fixture
def more_files(comm, shared_path, monkeypatch):
    """Two further files in the folder of the observables, and their names in the scene's tables."""
    if comm.rank == 0:
        (shared_path / "farthest.py").write_text(NEW_QUANTITY)
        (shared_path / "energy_density.py").write_text(NEW_FIELD)
    comm.Barrier()
    for registry in (declared.QUANTITIES, declared.FIELDS):
        for name in ("farthest_particle", "kinetic_energy_density"):
            monkeypatch.delitem(registry, name, raising=False)
    kept = dict(declared.QUANTITIES), dict(declared.FIELDS)
    monkeypatch.setattr(observables, "__path__", [*observables.__path__, str(shared_path)])
    observables.load()
    monkeypatch.setitem(observed.QUANTITIES, "farthest_particle", "scalar")
    monkeypatch.setitem(observed.FIELDS, "kinetic_energy_density", "scalar")
    yield
    for registry, before in zip((declared.QUANTITIES, declared.FIELDS), kept):
        registry.clear()
        registry.update(before)
    for module in ("farthest", "energy_density"):
        sys.modules.pop(f"parsolid.observables.{module}")


def test_a_new_probe_or_field_is_a_name_and_a_file(comm, more_files):
    probes = [
        {"name": "all", "quantity": "farthest_particle"},
        {"name": "corner", "at": [0.2, 0.2], "fields": ["kinetic_energy_density"]},
    ]
    columns, _, sim = sampled(spinning() | {"probes": probes}, comm, 5)
    reach = np.hypot(0.175, 0.175)
    assert columns["all.farthest_particle"][0] == pytest.approx(reach, rel=1e-12)
    # not extrapolated
    expected = 0.5 * 1000.0 * (SPEED * reach) ** 2
    assert columns["corner.kinetic_energy_density"][0] == pytest.approx(expected, rel=1e-12)
    assert Observables(sim.systems).field("kinetic_energy_density").shape == (sim.systems[0].owned,)


def test_what_scenes_may_name_is_what_is_computed():
    assert declared.QUANTITIES.keys() == observed.QUANTITIES.keys()
    assert declared.PARTICLE_SAMPLERS.keys() == observed.FIELDS_OF_PROBES.keys()
    assert declared.FIELDS.keys() == observed.FIELDS.keys() - {"velocity", "position", "deformation_gradient"}


def test_a_system_that_has_none_does_not_hide_what_another_has():
    def system(tip):
        settings = SimpleNamespace(extra_quantities={"crack_tip": "vector"})
        return SimpleNamespace(settings=settings, measure=lambda name: ("maximum", np.array(tip)))

    sampler = MethodQuantity("crack", ["x", "y"], "crack_tip")
    for pair in (([0.1, 0.2], [np.nan, np.nan]), ([np.nan, np.nan], [0.1, 0.2])):
        found = sampler.part(SimpleNamespace(systems=[system(tip) for tip in pair]))
        np.testing.assert_array_equal(found, [0.1, 0.2])


RING = {"shape": {"cylindrical_shell": {"centre": [0, 0], "radius": 1, "thickness": 0.3}}}
GRADED = {"shape": {"box": {"lower": [0, 0], "upper": [1, 1]}}, "particles": [20, 20], "grading": [[1, 20], [40, 1]]}


@pytest.mark.parametrize(
    ("method", "body"),
    [
        ({"kind": "tlsph"}, RING | {"particles": [24, 13]}),
        ({"kind": "mpm", "cell": 0.2}, RING | {"particles": [200, 3]}),
        ({"kind": "tlsph"}, GRADED),
    ],
    ids=["far apart around a ring", "far apart across it", "graded box"],
)
def test_linear_fields_are_exact_where_spacings_differ_by_direction_and_place(method, body, comm):
    material = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
    scene = {"dimension": 2, "end_time": 1.0, "method": method, "bodies": [body | {"material": material}]}
    particle_set = generate(parse_scene(scene), comm)
    particles = Particles(particle_set.body)
    declare_generated(particles, particle_set)
    whole = lambda place, others: np.zeros(len(others), bool)  # noqa: E731
    system = SimpleNamespace(particles=particles, bodies=[0], dimension=2, parted=whole)
    angle = np.linspace(0.05, 6.0, 17)
    places = [radius * np.stack([np.cos(angle), np.sin(angle)], axis=1) for radius in (0.85, 0.97, 1.15)]
    points = np.random.default_rng(1).random((40, 2)) if "grading" in body else np.concatenate(places)
    for point, place in zip(points, probe_points(comm, Observables([system]), points)):
        assert np.abs(place.continued).sum() < 3.0 and place.bounded.min() >= 0.0
        of = np.array([particle_set.position[particle_set.identifier == one].sum(axis=0) for one in place.identifiers])
        np.testing.assert_allclose(place.continued @ comm.allreduce(of), point, atol=1e-12)


@pytest.mark.parametrize("off", [0.0, 0.01])
def test_weights_of_particles_nearly_in_a_line_add_up_to_one_and_stay_small(off):
    place = point_among([(0, (0.72, 0.5)), (1, (0.72 - off, 1.3)), (2, (0.72, 2.0))])
    for weights in (place.continued, place.bounded):
        assert abs(weights.sum() - 1.0) < 1e-12 and np.abs(weights).max() < 3.0
