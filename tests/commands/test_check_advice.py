"""What `check` says of scenes that would run and be wrong."""

import numpy as np
import pytest
import tomli_w
from solids import RUBBER, simulation, supports, tables

from parsolid.api.check_advice import BENDING, advice, scene_advice, size_advice
from parsolid.commands.cli import main
from parsolid.methods.peridynamics import preconditioner
from parsolid.scene import parse_scene

METHODS = {"tlsph": {}, "mpm": {"cell": 0.05}, "peridynamics": {"horizon_ratio": 3}}


def beam(kind, across, placement, length=1.0, **rest) -> dict:
    """A body along X, 0.1 thick."""
    spacing = 0.1 / (across - (placement == "vertices"))
    along = round(length / spacing) + (placement == "vertices")
    material = {key: value for key, value in RUBBER.items() if key != "kind"} | {"poissons_ratio": 0.2}
    material["kind"] = "prony" if kind == "peridynamics" else "neo-hookean"
    method = METHODS[kind] | {"kind": kind} | ({"cell": 2.0 * spacing} if kind == "mpm" else {})
    return tables(
        [along, across], [length, 0.1], material=material, method=method, body={"placement": placement}, **rest
    )


@pytest.mark.serial
@pytest.mark.parametrize("kind, placement", sorted(BENDING))
def test_few_particles_across_a_beam(comm, kind, placement):
    figures = BENDING[kind, placement]
    two, many = (advice(simulation(beam(kind, across, placement), comm)) for across in (2, max(figures) + 1))
    assert len(two) == 1 and many == []
    assert two[0].code == "few-layers" and f" {figures[2]:g} times" in two[0].text


@pytest.mark.parametrize(
    "change, notes",
    [
        ({"boundaries": supports(Y=(0.0, "roller"))}, 0),
        ({"boundaries": supports(X=(0.0, "fixed"))}, 1),
        ({"boundaries": supports(Y=(0.0, "fixed"))}, 0),
        ({"boundaries": supports(Y0=(0.0, "roller"), Y1=(0.1, "roller"))}, 0),
        ({"length": 0.3}, 0),
    ],
)
def test_what_does_not_bend_is_not_told(change, notes):
    """A half of 3 has 5 nodes across, and is but 5 times as long as the whole is thick."""
    assert len(advice(simulation(beam("tlsph", 3, "vertices", **change)))) == notes


def test_a_face_that_is_loaded_through_weights_that_do_not_close():
    pulled = [{"plane": "X = 1", "kind": "traction", "traction": ["1", "0"]}]
    kernel, best = (
        advice(simulation(tables((5, 5), method=one, boundaries=pulled))) for one in ({}, {"weights": "best"})
    )
    assert [one.code for one in kernel] == ["loaded-faces"] and best == []


def test_a_thin_shell():
    shell = {"cylindrical_shell": {"base": [0.0] * 3, "axis": "Z", "radius": 1.0, "thickness": 0.1, "length": 1.0}}
    data = tables([40, 6, 2], body={"shape": shell})
    (found,) = advice(simulation(data))
    assert found.code == "few-layers" and " 2.3 times" in found.text


def test_check_prints_what_it_knows(tmp_path, capsys):
    data = tables([21, 3], [1.0, 0.1], body={"jitter": 0.1}, end_time=1e-6)
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(data))

    def codes(*words):
        assert main(["check", str(tmp_path / "scene.toml"), *words]) == 0
        return [line.rpartition(" ")[2] for line in capsys.readouterr().out.splitlines() if line.endswith("]")]

    assert codes() == ["[uneven-particles]", "[few-layers]"]
    assert codes("--silence", "few-layers") == ["[uneven-particles]"]
    assert main(["check", str(tmp_path / "scene.toml"), "--silence", "few-layer"]) == 2


def test_a_part_between_two_held_regions_is_told_what_its_control_does():
    regions = [{"name": side, "formula": f"X {sign}"} for side, sign in (("left", "< 0.2"), ("right", "> 0.8"))]
    held = [{"kind": "fixed", "where": "left"}, {"kind": "velocity", "where": "right", "velocity": [0, 0.1]}]
    for control, count in (({}, 1), ({"stabilisation": {"coefficient": 1.0}}, 0)):
        data = tables((6, 6), method={"kind": "peridynamics"} | control, boundaries=held, regions=regions)
        notes = scene_advice(parse_scene(data))
        assert len(notes) == count and all(one.code == "sheared-part" for one in notes)


@pytest.mark.parametrize(
    "method, stated",
    [
        ({"kind": "peridynamics"}, {"stabilisation": {"coefficient": 0.35}}),
        ({"kind": "peridynamics", "damage": {"fracture_energy": 1.0}}, {"stabilisation": {"coefficient": 0.35}}),
        ({"kind": "mpm", "cell": 0.2}, {"transfer": "apic"}),
    ],
)
def test_bodies_in_contact_are_told_what_their_methods_do_for_it(method, stated):
    box = {"particles": [10, 10], "placement": "cells"}
    box["material"] = {"kind": "linear-elastic", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
    if method["kind"] == "mpm":
        box["material"]["kind"] = "neo-hookean"
    shapes = ({"box": {"lower": [0.0, low], "upper": [1.0, low + 1.0]}} for low in (0.0, 1.0))
    bodies = [box | {"name": name, "shape": shape} for name, shape in zip("ab", shapes)]
    data = {"dimension": 2, "end_time": 1.0, "bodies": bodies, "contact": [{"bodies": ["a", "b"]}]}
    (note,) = scene_advice(parse_scene(data | {"method": method}))
    assert note.code == ("transfer-in-contact" if method["kind"] == "mpm" else "stabilisation-in-contact")
    assert scene_advice(parse_scene(data | {"method": method | stated})) == []
    assert scene_advice(parse_scene(data | {"method": method, "contact": []})) == []
    (same,) = scene_advice(parse_scene(data | {"methods": [method | {"name": "only"}]}))
    assert same == (note.code, note.text.replace("method.", "methods.0."))


@pytest.mark.serial
def test_a_mesh_in_millimetres_is_told_how_large_it_is_and_how_slow_its_waves_are(tmp_path, comm):
    import meshio

    points = 90.0 * np.array([[i, j] for j in range(3) for i in range(3)])
    cells = np.array([[k, k + 1, k + 4, k + 3] for k in (0, 1, 3, 4)])
    path = tmp_path / "part.vtu"
    meshio.Mesh(points, [("quad", cells)]).write(path)
    material = {"kind": "neo-hookean", "density": 7800, "youngs_modulus": 210e9, "poissons_ratio": 0.3}
    waves, still = {"kind": "tlsph"}, {"kind": "peridynamics", "solution": {"kind": "quasi-static", "step": 1e-3}}
    weight = {"loads": {"acceleration": [0.0, -9.81]}}
    large = [(waves, 1.0, {}, 1), (still, 1.0, {}, 1), (still, 1.0, weight, 0)]
    for method, scale, more, count in (*large, (waves, 1e-3, {}, 0), (still, 0.005, {}, 0)):
        body = {"shape": {"mesh": {"file": str(path), "scale": scale}}, "material": material}
        held = [{"kind": "fixed", "plane": "X = 0", "mirror": False}]
        scene = {"dimension": 2, "end_time": 1e-3, "method": method, "bodies": [body], "boundaries": held} | more
        notes = [note for note in size_advice(simulation(scene, comm)) if note.code == "mesh-scale"]
        assert len(notes) == count
        assert not notes or ("180 x 180 m" in notes[0].text and (method != waves or "0.0299 s" in notes[0].text))


@pytest.mark.parametrize("ratio, most, told", [(0.4999, 100, True), (0.4999, 10_000, False), (0.49, 100, False)])
def test_stiff_volumes_of_a_large_body_are_told_what_they_cost(comm, monkeypatch, ratio, most, told):
    """Where the pressures are too many to be factorised."""
    monkeypatch.setattr(preconditioner, "_MOST_FACTORISED", {2: most})
    solution = {"kind": "quasi-static", "step": 1.0}
    material = {"kind": "linear-elastic", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": ratio}
    method = {"kind": "peridynamics", "solution": solution}
    data = tables((18, 14), material=material, method=method, boundaries=supports(X=(0.0, "fixed")))
    notes = [note for note in advice(simulation(data, comm)) if note.code == "stiff-volumes"]
    assert len(notes) == told
    assert not told or "252 particles" in notes[0].text


@pytest.mark.parametrize(
    "jitter, how, told", [(0.2, "consistent", 1), (0.0, "consistent", 0), (0.2, "consistent-everywhere", 0)]
)
def test_uneven_particles_under_a_traction_are_told_what_that_costs(jitter, how, told):
    load = [{"kind": "traction", "plane": "X = 1", "traction": ["1", "0"]}]
    method = {"kind": "peridynamics", "traction": how, "solution": {"kind": "quasi-static", "step": 1.0}}
    material = {"kind": "linear-elastic", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.3}
    body = {"jitter": jitter, "placement": "cells"}
    data = tables((8, 8), material=material, method=method, boundaries=load, body=body)
    notes = scene_advice(parse_scene(data))
    assert len(notes) == told and all(note.code == "uneven-traction" for note in notes)
