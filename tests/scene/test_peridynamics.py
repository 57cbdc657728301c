"""Peridynamic scenes: each bad key gives one clear message; what is stated is what is meant."""

import copy
import pickle
import re

import numpy as np
import pytest

from parsolid.particles.generation import generate
from parsolid.particles.regions import selected
from parsolid.scene import SceneError, parse_scene

TERMS = [{"ratio": 9.0, "tau": 1.0}]
MATERIAL = {"kind": "prony", "density": 1000.0, "youngs_modulus": 7e6, "poissons_ratio": 0.3, "terms": TERMS}
PLATE = {
    "dimension": 2,
    "end_time": 10.0,
    "method": {"kind": "peridynamics"},
    "bodies": [
        {
            "shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 0.5]}},
            "particles": [10, 5],
            "placement": "cells",
            "material": MATERIAL,
        }
    ],
    "boundaries": [],
}


def plate(method=(), material=None, boundaries=(), dimension=2, **more):
    """A plate (bar, block) with changed tables."""
    data = copy.deepcopy(PLATE)
    data["method"] |= dict(method)
    body = data["bodies"][0]
    body["material"] = {**MATERIAL, **material} if material is not None else MATERIAL
    body["material"] = {key: value for key, value in body["material"].items() if value is not None}
    body["shape"] = {"box": {"lower": [0.0] * dimension, "upper": [1.0, 0.5, 0.5][:dimension]}}
    body["particles"] = [10, 5, 5][:dimension]
    data["boundaries"] = list(boundaries)
    return data | {"dimension": dimension} | more


PULL = {"kind": "traction", "plane": "X = 1", "traction": [1e6, 0.0]}
HELD = {"kind": "displacement", "plane": "X = 1", "displacement": ["0.1*t", "free"]}

BROKEN = {
    "horizon": (plate({"horizon_ratio": 0.5}), "method.horizon_ratio: expected a number >= 1, found 0.5"),
    "influence": (plate({"influence": "cubic"}), "method.influence: expected 'constant', 'linear' or .*found 'cubic'"),
    "plane in space": (
        plate({"plane": "stress"}, dimension=3),
        "method.plane: expected no such key but in 2-D, found 'stress'",
    ),
    "unknown plane": (plate({"plane": "stretch"}), "method.plane: expected 'stress' or 'strain' .*found 'stretch'"),
    "four dimensions": (plate(dimension=2) | {"dimension": 4}, "dimension: expected 1, 2 or 3, found 4"),
    "stabilisation": (
        plate({"stabilisation": {"kind": "shear"}}),
        "method.stabilisation.kind: expected 'shear-scaled' or 'none'.*found 'shear'",
    ),
    "stabilisation of nothing": (
        plate({"stabilisation": {"kind": "none", "coefficient": 1.0}}),
        "method.stabilisation.coefficient: expected no such key without control, found 1.0",
    ),
    "unknown solution": (
        plate({"solution": {"kind": "implicit"}}),
        "method.solution.kind: expected one of 'explicit', 'quasi-static' .*found 'implicit'",
    ),
    "solution as text": (plate({"solution": "explicit"}), "method.solution: expected a table, found 'explicit'"),
    "no material step": (
        plate({"solution": {"kind": "quasi-static"}}),
        r"method.solution.step: expected the material step \[s\], found nothing",
    ),
    "unknown solver": (
        plate({"solution": {"kind": "quasi-static", "step": 0.1, "solver": "conjugate-gradient"}}),
        "method.solution.solver: .*did you mean 'conjugate-gradients'.*found 'conjugate-gradient'",
    ),
    "step of an explicit solution": (
        plate({"solution": {"kind": "explicit", "step": 0.1}}),
        "method.solution.step: expected one of kind, safety, damage_safety, found the unknown key 'step'",
    ),
    "safety": (
        plate({"solution": {"kind": "explicit", "safety": 1.5}}),
        "method.solution.safety: expected a number <= 1, found 1.5",
    ),
    "steps": (
        plate({"maximum_step": 1e-6, "minimum_step": 1e-3}),
        "method.minimum_step: expected at most maximum_step = 1e-06, found 0.001",
    ),
    "damage by nothing": (
        plate({"damage": {}}),
        "method.damage: expected exactly one of fracture_energy, critical_stretch, critical_bond_energy, found none",
    ),
    "stretch as an energy": (
        plate({"damage": {"criterion": "energy", "critical_stretch": 0.01}}),
        "method.damage.critical_stretch: expected no such key with criterion = 'energy', found 0.01",
    ),
    "degenerate share": (
        plate({"damage": {"critical_stretch": 0.01, "largest_damage": 1.2}}),
        "method.damage.largest_damage: expected a number <= 1, found 1.2",
    ),
    "crack nowhere": (
        plate({"pre_cracks": [{}]}),
        "method.pre_cracks.0: expected exactly one of plane, segment, rectangle, found none",
    ),
    "crack of one end": (
        plate({"pre_cracks": [{"segment": [[0.0, 0.0]]}]}),
        "method.pre_cracks.0.segment: expected a list of at least 2, found",
    ),
    "crack without length": (
        plate({"pre_cracks": [{"segment": [[0.5, 0.2], [0.5, 0.2]]}]}),
        "method.pre_cracks.0.segment: expected points that do not lie on one place",
    ),
    "flat crack": (
        plate({"pre_cracks": [{"rectangle": [[0.0] * 3, [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]}]}, dimension=3),
        "method.pre_cracks.0.rectangle: expected points that do not lie on one line",
    ),
    "rectangle in the plane": (
        plate({"pre_cracks": [{"rectangle": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]}]}),
        "method.pre_cracks.0.rectangle: expected no such key but in 3-D",
    ),
    "crack in a box without plane": (
        plate(
            {"pre_cracks": [{"segment": [[0.5, 0.2], [0.5, 0.3]], "box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}}]}
        ),
        "method.pre_cracks.0.box: expected no such key without plane",
    ),
    "traction": (plate({"traction": "face"}), "method.traction: expected 'consistent', .* found 'face'"),
    "no modulus": (
        plate(material={"youngs_modulus": None}),
        "bodies.0.material: expected exactly one of youngs_modulus, shear_modulus, found none",
    ),
    "no second constant": (
        plate(material={"poissons_ratio": None}),
        "bodies.0.material.poissons_ratio: expected exactly one of poissons_ratio, bulk_modulus, found nothing",
    ),
    "both constants": (
        plate(material={"bulk_modulus": 1e9}),
        (
            "bodies.0.material: expected at most one of poissons_ratio, bulk_modulus, "
            "found poissons_ratio and bulk_modulus"
        ),
    ),
    "soft bulk": (
        plate(material={"poissons_ratio": None, "bulk_modulus": 1e5}),
        (
            "bodies.0.material.bulk_modulus: expected a bulk modulus of more than a ninth of "
            "Young's modulus 7e.06 .*found 100000.0"
        ),
    ),
    "bulk too soft at first": (
        plate(material={"bulk": "elastic"}),
        (
            "bodies.0.material.poissons_ratio: expected a bulk modulus of more than a ninth of "
            "Young's modulus 7e.07 .*found 0.3"
        ),
    ),
    "conversion of nothing": (
        plate(material={"conversion": "paper"}),
        (
            "bodies.0.material.conversion: expected no such key but with youngs_modulus and "
            "bulk = 'elastic', found 'paper'"
        ),
    ),
    "term of no stiffness": (
        plate(material={"terms": [{"tau": 1.0}]}),
        "bodies.0.material.terms.0: expected exactly one of modulus, ratio, found none",
    ),
    "relaxation time": (
        plate(material={"terms": [{"ratio": 1.0, "tau": 0.0}]}),
        "bodies.0.material.terms.0.tau: expected a number > 0, found 0.0",
    ),
    "terms of an elastic solid": (
        plate(material={"kind": "linear-elastic"}),
        "bodies.0.material.terms: expected a list of at most 0, found",
    ),
    "other method's material": (
        plate() | {"method": {"kind": "tlsph"}},
        "bodies.0.material.kind: expected one of 'mooney-rivlin', 'neo-hookean'.*, found 'prony'",
    ),
    "other method's support": (
        plate(boundaries=[{"kind": "wall", "plane": "X = 0", "side": "above"}]),
        "boundaries.0.kind: expected one of .*, found 'wall'",
    ),
    "displacement nowhere": (
        plate(boundaries=[{"kind": "displacement", "displacement": ["0", "0"]}]),
        "boundaries.0: expected exactly one of where, plane, box, ball, point, found none",
    ),
    "side of a layer": (
        plate(boundaries=[{"kind": "layer", "plane": "X = 0.3"}]),
        "boundaries.0.side: expected 'above' or 'below': .*found nothing",
    ),
    "jumps out of order": (
        plate(boundaries=[HELD | {"jumps": [2.0, 1.0]}]),
        "boundaries.0.jumps.1: expected a time later than the one before, found 1.0",
    ),
    "history of nothing": (
        plate(boundaries=[PULL | {"history": {}}]),
        "boundaries.0.history: expected exactly one of rows, file, found none",
    ),
    "history that goes back": (
        plate(boundaries=[PULL | {"history": {"rows": [[0.0, 1.0], [2.0, 1.0], [1.0, 0.0]]}}]),
        "boundaries.0.history.rows.2: expected times from 0 on that do not fall, found 1.0",
    ),
    "history before the start": (
        plate(boundaries=[PULL | {"history": {"rows": [[-1.0, 1.0]]}}]),
        "boundaries.0.history.rows.0: expected times from 0 on that do not fall, found -1.0",
    ),
    "history of three columns": (
        plate(boundaries=[PULL | {"history": {"rows": [[0.0, 1.0, 2.0]]}}]),
        "boundaries.0.history.rows.0: expected a list of at most 2, found",
    ),
    "missing history": (
        plate(boundaries=[PULL | {"history": {"file": "nowhere.csv"}}]),
        "boundaries.0.history.file: expected an existing file, found '.*nowhere.csv'",
    ),
    "a solution of small strain": (
        plate(
            bodies=[PLATE["bodies"][0] | {"material": MATERIAL | {"strain": "finite"}}],
            boundaries=[PULL],
            reference={"exact": "uniaxial-creep", "history": True},
        ),
        "reference.exact: expected a solution for strain = 'finite', found 'uniaxial-creep'",
    ),
    "history in another format": (
        plate(boundaries=[PULL | {"history": {"file": __file__}}]),
        "boundaries.0.history.file: expected ",
    ),
}


@pytest.mark.parametrize(("data", "message"), BROKEN.values(), ids=BROKEN)
def test_one_clear_message(data, message):
    with pytest.raises(SceneError) as caught:
        parse_scene(data)
    assert len(caught.value.faults) == 1, caught.value.faults
    assert re.search(message, caught.value.faults[0]), caught.value.faults[0]


def test_a_layer_away_from_the_body_is_refused(comm):
    scene = parse_scene(plate(boundaries=[{"kind": "layer", "plane": "X = -0.1", "side": "below"}]))
    with pytest.raises(SceneError, match="boundaries.0: expected a region that holds particles, found 0"):
        generate(scene, comm)


def test_defaults_and_states_of_strain():
    method = parse_scene(plate()).method
    assert method.horizon(0.1) == pytest.approx(0.3015)
    assert (method.solution.kind, method.solution.safety, method.stabilisation.factor) == ("explicit", 0.8, 0.35)
    assert [method.state(dimension) for dimension in (1, 2, 3)] == ["bar", "plane-strain", "space"]
    assert parse_scene(plate({"plane": "stress"})).method.state(2) == "plane-stress"


def test_scenes_round_trip():
    layer = {
        "kind": "layer",
        "plane": "X = 0.3",
        "side": "below",
        "displacement": ["0.1*t", "free"],
        "jumps": [0.0, 5.0],
    }
    pull = PULL | {"history": {"rows": [[0.0, 1.0], [5.0, 1.0], [5.0, 0.0]]}}
    method = {
        "pre_cracks": [{"segment": [[0.5, 0.0], [0.5, 0.2]]}],
        "damage": {"fracture_energy": 10.0, "modulus": 1e6},
    }
    scene = parse_scene(plate(method, boundaries=[layer, pull], loads={"acceleration": [0.0, -9.81], "jumps": [1.0]}))
    assert parse_scene(scene.resolved()) == scene


@pytest.mark.parametrize("kind", ["prony", "linear-elastic", "bond-based"])
def test_a_solid_goes_to_other_ranks(kind):
    left_out = {"prony": {}, "linear-elastic": {"terms": []}, "bond-based": {"terms": None, "poissons_ratio": None}}
    scene = parse_scene(plate(material={"kind": kind} | left_out[kind]))
    assert pickle.loads(pickle.dumps(scene)) == scene == parse_scene(scene.resolved())


def test_elastic_constants_of_a_material():
    material = (
        parse_scene(plate(material={"bulk": "elastic", "poissons_ratio": None, "bulk_modulus": 7e8})).bodies[0].material
    )
    before, after = material.instantaneous, material.equilibrium
    assert (before.youngs_modulus, after.youngs_modulus) == pytest.approx((7e7, 7e6))
    assert before.bulk_modulus == pytest.approx(after.bulk_modulus)
    for E, G, K, nu in (before, after):
        assert (3.0 * K * (1.0 - 2.0 * nu), 2.0 * G * (1.0 + nu)) == pytest.approx((E, E))
    shear = parse_scene(plate(material={"youngs_modulus": None, "shear_modulus": 2e6})).bodies[0].material
    assert shear.equilibrium.youngs_modulus == pytest.approx(5.2e6)
    assert shear.instantaneous.poissons_ratio == pytest.approx(0.3)


ROWS = [[0.0, 0.0], [1.0, 2.0], [1.0, 5.0], [3.0, 5.0], [3.0, 0.0]]


@pytest.mark.parametrize("by_file", [False, True])
def test_histories_of_loads(by_file, tmp_path):
    table = {"rows": ROWS}
    if by_file:
        (tmp_path / "load.csv").write_text("time,factor\n" + "".join(f"{time},{factor}\n" for time, factor in ROWS))
        table = {"file": "load.csv"}
    scene = parse_scene(plate(boundaries=[PULL | {"history": table, "jumps": [2.0]}]), tmp_path)
    traction = scene.boundaries[0]
    assert traction.jump_times == [1.0, 2.0, 3.0]
    at = np.zeros((1, 2))
    sides = {0.0: (0.0, 0.0), 0.5: (1.0, 1.0), 1.0: (2.0, 5.0), 2.0: (5.0, 5.0), 3.0: (5.0, 0.0), 9.0: (0.0, 0.0)}
    for time, (before, after) in sides.items():
        values = [traction.prescribed.evaluate(at, time, side)[0, 0] for side in (True, False)]
        assert values == pytest.approx([before * 1e6, after * 1e6]), time


def test_formulas_that_jump():
    held = HELD | {"displacement": ["where(t < 2, 0.1, where(t <= 4, 0.2, 0.3))", "free"], "jumps": [2.0, 4.0]}
    prescribed = parse_scene(plate(boundaries=[held])).boundaries[0].prescribed
    at = np.zeros((1, 2))
    sides = {
        time: [prescribed.evaluate(at, time, before)[0, 0] for before in (True, False)] for time in (1.0, 2.0, 3.0, 4.0)
    }
    assert sides == {1.0: [0.1, 0.1], 2.0: [0.1, 0.2], 3.0: [0.2, 0.2], 4.0: [0.2, 0.3]}
    assert list(prescribed.free) == [False, True] and not prescribed.component(0).free[0]


def test_a_history_that_starts_with_a_load_jumps_there():
    scene = parse_scene(plate(boundaries=[PULL | {"history": {"rows": [[0.5, 1.0]]}}]))
    assert scene.boundaries[0].jump_times == [0.5]
    assert [scene.boundaries[0].history.factor(0.5, before) for before in (True, False)] == [0.0, 1.0]


def test_particles_of_a_layer(comm):
    boundary = {"kind": "layer", "plane": "X = 0.3", "side": "below"}
    scene = parse_scene(plate(boundaries=[boundary]))
    particle_set = generate(scene, comm)
    chosen = selected(scene, scene.boundaries[0], particle_set, comm)
    assert np.array_equal(chosen, particle_set.position[:, 0] < 0.3)
    assert comm.allreduce(int(chosen.sum())) == 15


@pytest.mark.parametrize("dimension, plane", [(2, "stress"), (1, None)])
def test_hyperelastic_solids_know_no_free_thickness(dimension, plane):
    """They had the energy of plane strain."""
    material = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
    box = {"lower": [0.0] * dimension, "upper": [1.0] * dimension}
    body = {"shape": {"box": box}, "particles": [8] * dimension, "placement": "cells", "material": material}
    method = {"kind": "peridynamics"} | ({} if plane is None else {"plane": plane})
    tables = {"dimension": dimension, "end_time": 1e-3, "method": method, "bodies": [body]}
    with pytest.raises(SceneError, match=r"bodies.0.material.kind: expected a law that knows .*, found 'neo-hookean'"):
        parse_scene(tables)
    if dimension == 2:
        assert parse_scene(tables | {"method": method | {"plane": "strain"}})
