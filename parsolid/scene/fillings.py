"""Which filling belongs to which shape."""

from parsolid.scene.bodies import Body
from parsolid.scene.lattice import BoxFilling, Filling

_LATTICES = {"box": BoxFilling}


def lattice_filling(body: Body, dimension: int) -> Filling:
    """The particles of a body whose shape is known without reading a file."""
    return _LATTICES[body.shape.kind](body, dimension)


def mesh_filling(body: Body, dimension: int) -> Filling:
    """The particles of a body that a mesh file describes. Raises SceneError when the mesh cannot be used."""
    raise NotImplementedError
