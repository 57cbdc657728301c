"""What material points in contact have where a scene states no transfer."""

import pytest

from parsolid.scene import parse_scene

RUBBER = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}


def blocks(method: dict, contact: dict | None) -> dict:
    """Two squares of material points."""
    box = {"particles": [10, 10], "placement": "cells", "material": RUBBER}
    shapes = ({"box": {"lower": [0.0, low], "upper": [1.0, low + 1.0]}} for low in (0.0, 1.0))
    bodies = [box | {"name": name, "shape": shape} for name, shape in zip("ab", shapes)]
    data = {"dimension": 2, "end_time": 1.0, "bodies": bodies, "method": {"kind": "mpm", "cell": 0.2} | method}
    return data if contact is None else data | {"contact": [{"bodies": ["a", "b"]} | contact]}


@pytest.mark.parametrize(
    ("method", "contact", "transfer", "fraction"),
    [
        ({}, None, "apic", 1.0),
        ({"flip_fraction": 0.9}, None, "flip", 0.9),
        ({"basis": "linear"}, None, "flip", 1.0),
        ({}, {"model": "grid"}, "apic", 1.0),
        ({}, {}, "aflip", 0.99),
        ({"transfer": "flip"}, {}, "flip", 1.0),
        ({"transfer": "apic"}, {}, "apic", 1.0),
        ({"flip_fraction": 0.9}, {}, "flip", 0.9),
        ({"basis": "linear"}, {}, "flip", 1.0),
    ],
)
def test_only_what_is_in_contact_and_states_none_has_another(method, contact, transfer, fraction):
    scene = parse_scene(blocks(method, contact))
    # what is written with results says the same again
    for one in (scene, parse_scene(scene.resolved())):
        assert (one.method.transfer, one.method.flip_fraction) == (transfer, fraction)
        assert {system.settings.transfer for system in one.systems} == {transfer}


@pytest.mark.serial
def test_slopes_on_linear_weights_are_told_without_contact_too():
    def told(method: dict) -> list[str]:
        scene = parse_scene(blocks(method, None))
        return scene.systems[0].settings.notes(scene, scene.systems[0].bodies)

    (note,) = told({"basis": "linear", "transfer": "aflip"})
    assert note.code == "unstable-transfer"
    assert told({"basis": "linear"}) == told({"transfer": "aflip"}) == []
