"""Bodies that touch are named by a table, bonds by bodies that touch, in every method and on any number of ranks."""

import pytest
from scene.plain_tables import MATERIAL

from parsolid.particles.generation import generate
from parsolid.scene import SceneError, parse_scene

COPPER = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
METHODS = {
    "tlsph": {"kind": "tlsph"},
    "peridynamics": {"kind": "peridynamics", "horizon_ratio": 3.0, "solution": {"kind": "explicit"}},
    "mpm": {"kind": "mpm", "cell": 0.25},
    "ulsph": {"kind": "ulsph"},
}
# gaps [m] of cells 1/8 m wide that no particles act across: of 0.85 + 0.85, 3.015, 3 cells of two, and 2.6 spacings
APART = {"tlsph": 0.1, "peridynamics": 0.26, "mpm": 0.63, "ulsph": 0.21}


def tables(*lower: float, method="tlsph", dimension=2, **more) -> dict:
    """Raw tables of cubes of 1 m, called a, b ... from X = lower."""
    bodies = []
    for name, start in zip("abcdefgh", lower):
        box = {"lower": [start] + [0.0] * (dimension - 1), "upper": [start + 1.0] + [1.0] * (dimension - 1)}
        material = COPPER if method == "ulsph" else MATERIAL
        body = {"name": name, "shape": {"box": box}, "spacing": 0.125, "placement": "cells", "material": material}
        bodies.append(body)
    return {"dimension": dimension, "end_time": 1.0, "method": METHODS[method], "bodies": bodies} | more


def faults(data: dict, comm) -> list:
    with pytest.raises(SceneError) as caught:
        generate(parse_scene(data), comm)
    assert len(set(map(str, comm.allgather(caught.value)))) == 1
    return caught.value.faults


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("method", METHODS)
def test_bodies_that_act_on_one_another_are_named(comm, method, dimension):
    near, far = APART[method] - 0.02, APART[method] + 0.02
    row = (0.0, 1.0, 2.0 + near, 3.0 + near + far)
    data = tables(*row, method=method, dimension=dimension)
    (fault,) = faults(data, comm)
    assert (fault.code, fault.key) == ("touching", "bodies")
    assert fault.found == "none for 'a' and 'b', 'b' and 'c'"
    assert all(f"[[{table}]]" in fault.expected for table in ("contact", "tie", "bond"))
    (fault,) = faults(data | {"bond": [{"bodies": ["a", "b"]}]}, comm)
    assert fault.found == "none for 'b' and 'c'"
    contact = [{"bodies": ["b", "c"]} | ({"model": "grid"} if method == "mpm" else {})]
    for named in ({"bond": [{"bodies": "all"}]}, {"bond": [{"bodies": ["a", "b"]}], "contact": contact}):
        generate(parse_scene(data | named), comm)


@pytest.mark.parametrize("method", METHODS)
def test_bonds_without_effect_are_refused(comm, method):
    apart = tables(0.0, 2.0, 3.0, method=method)
    (fault,) = faults(apart | {"bond": [{"bodies": ["a", "b"]}, {"bodies": ["b", "c"]}]}, comm)
    assert (fault.code, fault.key) == ("touching", "bond.0.bodies") and "'a'" in fault.found and "'b'" in fault.found
    (fault,) = faults(apart | {"bond": [{"bodies": ["a", "b", "c"]}]}, comm)
    assert fault.key == "bond.0.bodies" and "'b'" not in fault.found
    (fault,) = faults(tables(0.0, 2.0, method=method) | {"bond": [{"bodies": "all"}]}, comm)
    assert fault.key == "bond.0.bodies"


def test_bodies_of_two_methods_are_tied_or_in_contact(comm):
    data = tables(0.0, 1.0)
    data["methods"] = [METHODS[name] | {"name": name} for name in ("tlsph", "peridynamics")]
    del data["method"]
    for body, name in zip(data["bodies"], ("tlsph", "peridynamics")):
        body["method"] = name
    (fault,) = faults(data, comm)
    assert fault.code == "touching" and "'a' and 'b'" in fault.found
    (fault,) = faults(data | {"bond": [{"bodies": ["a", "b"]}]}, comm)
    assert fault.key == "bond.0.bodies"
    for named in ("tie", "contact"):
        generate(parse_scene(data | {named: [{"bodies": ["a", "b"]}]}), comm)


def test_bodies_that_share_a_grid_and_are_bonded_have_one(comm):
    """Contact keeps a and b apart; c, which both touch, can stick to one of them alone."""
    contact = [{"bodies": ["a", "c"], "model": "grid"}]
    scene = parse_scene(tables(0.0, 1.0, 2.0, method="mpm", contact=contact, bond=[{"bodies": ["b", "c"]}]))
    assert [system.bodies for system in scene.systems] == [(0,), (1, 2)]
    (fault,) = faults(tables(0.0, 1.0, 2.0, method="mpm", contact=contact, bond=[{"bodies": "all"}]), comm)
    assert fault.key == "bond" and "'b' and 'c'" in fault.found
