"""What all boundary conditions have in common, and the table of their kinds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar, get_args

from parsolid.scene.base_model import ByKind, Plane, SceneModel
from parsolid.scene.formulas import Formula, FormulaVector
from parsolid.scene.regions import OnPlane

if TYPE_CHECKING:
    from parsolid.boundary.declarations import Declarations
    from parsolid.scene.regions import Region

BOUNDARY_KINDS = ByKind((), known="boundaries")
Boundary = Annotated[Any, BOUNDARY_KINDS]


class Condition(SceneModel):
    """A boundary condition with a literal field `kind`; its keys are those of its table in the scene.

    plane   a plane such as 'Y = 0'; particles on it are meant
    point   the particle nearest to this point [m] is meant
    body    only this body is meant; all of them unless given
    mirror  particles have images beyond the plane; without them those on the plane are clamped only

    on_particles: it is about particles of a region, else about nodes of a grid, wherever particles are;
    needs_bounding_plane: its plane must bound a body.
    """

    on_particles: ClassVar[bool] = True
    needs_bounding_plane: ClassVar[bool] = False
    if TYPE_CHECKING:
        # fields of the kinds, in the order of their tables
        kind: str
        plane: Plane | None
        body: str | None

    @property
    def region(self) -> Region:
        """Where it holds; the particles on its plane unless a kind says otherwise."""
        assert self.plane is not None
        return OnPlane(self.plane)

    @property
    def formulas(self) -> dict[str, FormulaVector]:
        """All formulas, by their key."""
        stated = {key: getattr(self, key) for key in type(self).model_fields}
        vectors = {key: FormulaVector((one,)) if isinstance(one, Formula) else one for key, one in stated.items()}
        return {key: one for key, one in vectors.items() if isinstance(one, FormulaVector)}

    def declare(self, to: Declarations) -> None:
        """State what it means in verbs of `boundary.declarations.Declarations`."""
        raise NotImplementedError


Kind = TypeVar("Kind", bound=Condition)


def boundary_kind(model: type[Kind]) -> type[Kind]:
    """Enter a kind in the table; raises ValueError for one that is there."""
    for kind in get_args(model.model_fields["kind"].annotation):
        if kind in BOUNDARY_KINDS.models:
            raise ValueError(f"boundary kinds: expected one of the name {kind!r}, found two")
        BOUNDARY_KINDS.models[kind] = model
    return model
