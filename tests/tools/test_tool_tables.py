"""Tables of tools that are refused, each with its key, and where extreme ones lead."""

import meshio
import numpy as np
import pytest
from tools.tool_scenes import METHODS, block, floor, run

from parsolid.collective import SolverError


def polygon(path, corners, segments=None):
    """A tool of a mesh file of a polygon."""
    points = np.hstack([corners, np.zeros((len(corners), 1))])
    segments = segments or [[i, (i + 1) % len(corners)] for i in range(len(corners))]
    meshio.write(path, meshio.Mesh(points, [("line", np.array(segments))]))
    return {"name": "wedge", "shape": {"mesh": {"file": str(path)}}}


WEDGE = np.array([[0.5, 0.51], [0.8, 0.9], [0.2, 0.9]])


@pytest.mark.parametrize(
    ("centre", "radius", "key"),
    [
        ([0.5, 0.6], 0.2, "tools.0.shape: .*'ball' within 'block' by 0.1 m"),
        # it fits between particles
        ([0.5, 0.9], 0.04, "tools.0.shape: .*'ball', 0.08 m"),
        (None, None, "tools.wedge.shape.mesh.file: .* 2 corners"),
    ],
)
def test_a_tool_in_a_body_or_narrow_or_open_is_refused(comm, shared_path, centre, radius, key):
    tool = {"name": "ball", "shape": {"sphere": {"centre": centre, "radius": radius}}}
    if centre is None:
        if comm.rank == 0:
            polygon(shared_path / "open.vtk", WEDGE, [[0, 1], [1, 2]])
        comm.Barrier()
        tool = {"name": "wedge", "shape": {"mesh": {"file": str(shared_path / "open.vtk")}}}
    with pytest.raises(SolverError, match=key):
        run(block("tlsph") | {"tools": [tool]}, comm)


@pytest.mark.serial
@pytest.mark.parametrize("turned", [False, True])
def test_a_sharp_corner_of_a_mesh_presses(tmp_path, turned):
    """Whichever way its segments run; the work of the motion is what the body and the contact take up."""
    order = [[1, 0], [1, 2], [0, 2]] if turned else None
    tool = polygon(tmp_path / "wedge.vtk", WEDGE, order) | {"motion": {"velocity": ["0", "-2"]}}
    data = block("tlsph", placement="cells", particles=[10, 5]) | {"tools": [tool], "end_time": 0.03}
    data["tools"].append(floor())
    data["method"]["maximum_step"] = 2e-4
    _, watch = run(data)
    assert watch["wedge.force_y"].max() > 1e3 and abs(watch["wedge.place_y"][-1] - (0.77 - 0.06)) < 1e-12
    assert np.abs(watch["wedge.force_x"]).max() < 1e-6 * watch["wedge.force_y"].max()
    assert np.abs(watch["energy_error"]).max() < 0.03 * watch["external_work"].max()


@pytest.mark.parametrize("stiffness", [0.01, 100.0])
def test_stiffness_from_soft_to_hard(stiffness):
    """The step follows it, the energy is kept, and momentum is given back."""
    data = block("tlsph", velocity=[0.0, -1.0], counts=(4, 4), lower=(0.0, 0.01)) | {"end_time": 0.06}
    data |= {"tools": [floor(stiffness=stiffness)]}
    _, watch = run(data)
    assert watch["velocity"][-1, 1] > 0.7
    assert np.abs(watch["energy_error"]).max() < (0.05 if stiffness > 1.0 else 0.01) * watch["kinetic"][0]


@pytest.mark.parametrize("method", ["ulsph", "mpm"])
def test_three_kilometres_a_second(method):
    """A block that is crushed on a plane: nothing goes through it, and the momentum is that of the force."""
    data = block(method, counts=(4, 8), velocity=[0.0, -3000.0], lower=(0.0, 0.005))
    copper = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
    data["bodies"][0] |= {"material": copper}
    if method == "ulsph":
        data["method"] |= {"viscosity": {"linear": 1.0, "quadratic": 1.0}}
    sim, watch = run(data | {"end_time": 4e-5, "tools": [floor()]})
    assert sim.systems[0].particles.owned_rows("position")[:, 1].min() > -0.05
    force, time = -watch["floor.force_y"], watch["time"]
    impulse = float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(time)))
    gained = (watch["velocity"][-1, 1] + 3000.0) * watch["mass"][0]
    assert gained > 0.1 * 3000.0 * watch["mass"][0] and abs(impulse / gained - 1.0) < 0.01


@pytest.mark.parametrize("method", METHODS)
def test_far_tools_are_left_alone(method):
    """Nothing is computed before a tool could have come near."""
    data = block(method) | {"end_time": 1e-2, "tools": [floor(motion={"velocity": ["0", "0.1"]})]}
    data["tools"][0]["shape"]["plane"]["point"] = [0.0, -3.0]
    sim, watch = run(data, steps=5)
    touch = sim.interactions[0].tools[0].touches[0]
    assert touch.quiet_until > 10.0 * sim.clock.step_size and not watch["floor.force_y"].any()
