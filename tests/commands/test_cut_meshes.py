"""Bodies of meshes cut open: what is between the particles is drawn, as it is of lattices."""

import numpy as np
import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("pyvista")
import meshio

from parsolid.commands.plot.space import Cut, cut_body
from parsolid.particles.skins import skins_of
from parsolid.scene import parse_scene

pytestmark = pytest.mark.serial
# of a cube of 8 nodes, counted along z first, then y
CORNERS = [0, 4, 6, 2, 1, 5, 7, 3]
SIX = [[0, 4, 6, 7], [0, 6, 2, 7], [0, 2, 3, 7], [0, 3, 1, 7], [0, 1, 5, 7], [0, 5, 4, 7]]


@pytest.mark.parametrize("kind, cells", [("hexahedron", [CORNERS]), ("tetra", SIX)])
def test_a_mesh_that_is_cut_shows_a_closed_half_and_a_whole_section(tmp_path, kind, cells):
    points = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    meshio.write(tmp_path / "cube.vtk", meshio.Mesh(points, [(kind, np.array(cells))]))
    soft = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
    body = {"shape": {"mesh": {"file": str(tmp_path / "cube.vtk")}}, "material": soft}
    scene = {"dimension": 3, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": [body]}
    (skin,) = skins_of({0: parse_scene(scene).bodies[0]}, 3, np.zeros(8, int))
    assert skin.solid and not skin.by_particle().solid
    values = points[:, 0]
    half = cut_body(skin, points, values, points[:, 0], Cut(0, 0.25, above=False, present=False)).triangulate()
    # two faces of 1 m^2, four strips
    assert half.area == pytest.approx(3.0) and half["shown"].max() == pytest.approx(0.25)
    section = cut_body(skin, points, values, points[:, 0], Cut(0, 0.25, above=None, present=False)).triangulate()
    assert section.area == pytest.approx(1.0)
    assert cut_body(skin, points, values, points[:, 0], Cut(0, 2.0, above=True, present=False)) is None
