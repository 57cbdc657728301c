"""Which filling belongs to which shape but meshes; a new shape is a model in `shapes` and one entry here."""

from typing import Any

from parsolid.scene.bodies import FilledShape
from parsolid.scene.clipped import ClippedFilling
from parsolid.scene.lattice import BoxFilling, Filling
from parsolid.scene.perforated import PerforatedFilling
from parsolid.scene.perforated_nodes import PerforatedNodes
from parsolid.scene.shell import ShellFilling

_FILLINGS = {
    "box": BoxFilling,
    "perforated_box": PerforatedFilling,
    "cylindrical_shell": ShellFilling,
    "cylinder": ClippedFilling,
    "sphere": ClippedFilling,
}


def filling_of(body: FilledShape, dimension: int) -> Filling:
    """The particles of a body that is no mesh, not yet made."""
    filling: Any = _FILLINGS[body.shape.kind]
    if body.shape.kind == "perforated_box" and body.placed_on == "vertices":
        filling = PerforatedNodes
    made: Filling = filling(body, dimension)
    return made
