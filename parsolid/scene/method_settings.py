"""What the settings of all methods have in common."""

from collections.abc import Iterable
from math import inf
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from parsolid.scene.base_model import Detail, Name, NotNegative, OnRestart, Positive, SceneModel, reject
from parsolid.scene.codes import Note


class ArtificialViscosity(SceneModel):
    """Bulk viscosity in compression, q = rho h |tr d| (quadratic h |tr d| + linear c) with the edge h of a cell or the
    particle spacing; its work becomes internal energy.
    """

    linear: NotNegative = Field(0.2, description="factor of the sound speed")
    quadratic: NotNegative = Field(2.0, description="factor of the velocity jump over a cell or spacing")


# A factor on inertia for slow (quasi-static) motions: stable steps grow by its root. Weights, heat capacities and rates
# of flow do not change.
MassScaling = Annotated[
    float | None,
    Field(
        gt=1,
        le=1e8,
        description="factor on the mass of inertia of slow (quasi-static) motions, whose steps become longer by its "
        "root; weights stay as they are",
    ),
]

# by how much leapfrog's kinetic energy at the ends of steps exceeds the one that is conserved, see `methods.leapfrog`
KINETIC_OFFSET = "kinetic_offset"
# what bodies in motion lose where a stage of equilibria begins
STAGE_CHANGE = "stage_change"


# fields that particles of every method have, by name
COMMON_FIELDS = {"mass": "scalar", "share": "scalar", "spacing": "vector", "reference_position": "vector"}


class MethodSettings(SceneModel):
    """What every method has, and what it says of itself to the other tables of a scene.

    system                  module and class, "module:class"
    dimensions, materials   those of space, and the roles of laws, that the method takes
    boundaries              the kinds that it takes; refused: of others the reason, or what to use in place
    prescribes              what a scene may prescribe: "velocity", "displacement"
    reactions               kinds of boundaries of which it knows the force
    pressed                 keys of the places on which a pressure may act
    loads                   keys of the table `loads` that it takes
    declared_fields         those that a scene may name besides `COMMON_FIELDS`, as particles declare them
    extra_fields            others, name -> "scalar", "vector" or "tensor"
    extra_quantities        what it computes of all particles, by name
    pictured_fields         what colours the bodies: the first of these that was written
    ledger_terms            see `ledger.Ledger`; viscous_terms: those of them that artificial viscosity fills
    shared_field            whether bodies share a field of velocities and so stick together; those that do not need
                            systems of their own
    in_cells                whether lattices of particles are in the middle of cells, never on the surface
    strained                whether a displacement that another run left is a strain of the start
    initial_stress_refused  why a start has no stress of its own, None where it may
    stage_keys              keys that a stage of a run may change, see `scene.systems.Stage`

    What another run may start from, by names of declared fields (* for any end):

    state_variables         the state, with the places
    state_of_particles      those of the state that only the very same particles may take
    state_forces            what these take besides, if they are all of the run, and what others find anew
    contact_variables       what contact and tools keep with particles; the same particles take it where results have it
    """

    system: ClassVar[str]
    shared_field: ClassVar[bool] = False
    dimensions: ClassVar[tuple[int, ...]] = (2, 3)
    materials: ClassVar[tuple[str, ...]] = ()
    boundaries: ClassVar[tuple[str, ...]] = ()
    refused: ClassVar[dict[str, str]] = {}
    planes_move: ClassVar[bool] = False
    prescribes: ClassVar[tuple[str, ...]] = ("velocity",)
    reactions: ClassVar[tuple[str, ...]] = ()
    strained: ClassVar[bool] = True
    initial_stress_refused: ClassVar[str | None] = "its stress is that of its law alone"
    state_variables: ClassVar[tuple[str, ...]] = ("velocity",)
    state_of_particles: ClassVar[tuple[str, ...]] = ()
    state_forces: ClassVar[tuple[str, ...]] = ()
    stage_keys: ClassVar[tuple[str, ...]] = ()
    contact_variables: ClassVar[tuple[str, ...]] = (
        "contact_partner",
        "contact_stick",
        "stick_*",
        "external_impulse",
        "moved",
    )
    pressed: ClassVar[tuple[str, ...]] = ("plane", "where")
    loads: ClassVar[tuple[str, ...]] = ("body_force", "acceleration")
    declared_fields: ClassVar[tuple[Any, ...]] = ()
    extra_fields: ClassVar[dict[str, str]] = {}
    extra_quantities: ClassVar[dict[str, str]] = {}
    pictured_fields: ClassVar[tuple[str, ...]] = ("von_mises_stress", "pressure")
    ledger_terms: ClassVar[dict[str, int]] = {}
    viscous_terms: ClassVar[tuple[str, ...]] = ()
    graded_bodies: ClassVar[bool] = False
    in_cells: ClassVar[bool] = False
    on_restart: ClassVar = {
        **dict.fromkeys(("maximum_step", "minimum_step", "substeps", "dissipation_warning"), OnRestart.FREE),
        **dict.fromkeys(("balance_warning", "balance_limit", "cfl", "safety", "rebalance"), OnRestart.FREE),
        **dict.fromkeys(("kind", "reference", "weights", "mass_scaling"), OnRestart.FIXED),
    }
    kind: str
    name: Name | None = Field(None, description="of one of several methods: by which bodies call it")
    maximum_step: Positive | None = Field(None, description="the largest time step [s]")
    minimum_step: Positive | None = Field(None, description="the time step [s] below which the run stops")
    substeps: Annotated[int, Field(ge=1, le=64)] | Literal["auto"] | None = Field(
        None, description="steps of this method in a common one of several methods: a number, or 'auto'"
    )
    balance_warning: Positive = Field(0.01, description='energy unaccounted for from which a run is "unbalanced"')
    balance_limit: Positive = Field(0.05, description="energy unaccounted for, over the largest, at which a run fails")
    dissipation_warning: Positive = Field(
        0.1, description='numerical dissipation over the energy that went in from which a run is "dissipative"'
    )

    @property
    def inertia_factor(self) -> float:
        """The mass of inertia over that of the matter."""
        return getattr(self, "mass_scaling", None) or 1.0

    def faults_of_scaling(self, scene: Any, refused: str | None) -> list[Detail]:
        """Of `mass_scaling` where it has no effect or no meaning: refused, in words, None where a method has none."""
        if self.inertia_factor == 1.0:
            return []
        if refused is None and scene.loads.manufactured:
            refused = "with loads.manufactured, the accelerations of an exact motion"
        return [] if refused is None else [(("method", "mass_scaling"), f"no such key {refused}", self.inertia_factor)]

    @classmethod
    def field_kinds(cls, dimension: int | None) -> dict[str, str]:
        """Name -> kind of the fields that a scene may name."""
        kinds = {field.name: field.kind(dimension or 3) for field in cls.declared_fields}
        return COMMON_FIELDS | {name: kind for name, kind in kinds.items() if kind} | cls.extra_fields

    def energy_terms(self, scene: Any, bodies: Iterable[int]) -> dict[str, int]:
        """The method's `ledger_terms`, and those of the materials of its bodies, numbers of those of the scene."""
        terms = dict(self.ledger_terms)
        for i in bodies:
            terms |= getattr(scene.bodies[i].material, "ledger_terms", {})
        return terms

    def scene_faults(self, scene: Any) -> list[Detail]:
        """What the method cannot make of a scene's other tables: (location, expected, found)."""
        return []

    def defaults_for(self, scene: Any, bodies: Iterable[int]) -> dict[str, Any]:
        """Values of keys that a scene leaves out, where they are other than elsewhere for what it asks of bodies."""
        return {}

    def with_defaults(self, values: dict[str, Any]) -> Self:
        """A copy in which keys have values that the scene does not state."""
        result = self.model_copy(update=values)
        result.__pydantic_fields_set__.intersection_update(self.model_fields_set)
        return result

    def in_stage(self, stated: dict[str, Any]) -> Self:
        """These settings with those of a stage, of which each has its own or the usual ones. Raises ValidationError."""
        values = {key: getattr(self, key) for key in type(self).model_fields if key not in self.stage_keys}
        kept = {key: value for key, value in values.items() if key in self.model_fields_set}
        return type(self).model_validate(kept | stated).with_defaults(values)

    def notes(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        """What a scene asks for of the method's bodies that costs accuracy where it need not."""
        return []

    def without_state(self, name: str) -> str:
        """What a scene can state so that it does without a field of the method's state that results lack, in words."""
        return ""

    def ignored_keys(self, scene: Any, bodies: Iterable[int]) -> frozenset[str]:
        """Keys of the method that say nothing to these bodies."""
        return frozenset()

    def choices(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        """What the method chose for bodies where the scene states nothing, for `check`."""
        return []

    def touching(self) -> str:
        """What bodies of the method do that touch and that no contact names, in words."""
        return "bonded where they touch"

    def band(self, spacing: np.ndarray) -> np.ndarray:
        """Width (n,) [m] of the band in which the strain of particles with a spacing (n, d) [m] localises, measured on
        a neck that breaks (docs/laws.md): two spacings, as gradients are differences over two."""
        return np.asarray(2.0 * np.prod(spacing, axis=1) ** (1.0 / spacing.shape[1]))

    def reach(self, spacing: np.ndarray) -> np.ndarray:
        """Semi-axes (d,) [m] of the region around particles of a spacing (d,) [m] in which others feel them."""
        return np.zeros_like(spacing)

    def contact_distance(self, spacing: np.ndarray) -> np.ndarray:
        """Semi-axes (d,) [m] within which particles of two bodies of the method, of a spacing (d,) [m], have met."""
        return spacing

    def largest_spacing(self) -> float | None:
        """The largest particle spacing [m] that the method bears; None where there is no such limit."""
        return None

    def bending_fault(self, across: int, spacing: float) -> str | None:
        """Why slender bodies with so many particles of a spacing [m] across bend otherwise than their law says, in the
        method's keys; None where they do not."""
        return None

    def bonding(self, scene: Any, bodies: Iterable[int]) -> list[bool]:
        """For each of its bodies whether the method bonds it to others where they touch."""
        return [True for _ in bodies]

    def bonded_spacings(self, scene: Any) -> float:
        """By which factor spacings of bodies may differ that the method bonds."""
        return inf

    def bonded_moduli(self, scene: Any) -> float:
        """The same of their moduli of pressure waves."""
        return inf

    def contact_refused(self, scene: Any) -> str | None:
        """Why bodies of the method cannot be in contact, None where they can."""
        return "with this method"

    def tie_refused(self, scene: Any) -> str | None:
        """Why bodies of the method cannot be tied, None where they can."""
        return self.contact_refused(scene)

    def substeps_refused(self) -> str | None:
        """Why the method cannot take several steps in one that all methods take; None where it can."""
        return None

    def state(self, dimension: int) -> str:
        """The state of strain, "bar", "plane-strain", "plane-stress" or "space"."""
        return {1: "bar", 2: "plane-strain", 3: "space"}[dimension]

    @model_validator(mode="after")
    def _ordered(self) -> "MethodSettings":
        if self.maximum_step is not None and self.minimum_step is not None and self.minimum_step > self.maximum_step:
            reject((("minimum_step",), f"at most maximum_step = {self.maximum_step:g}", self.minimum_step))
        if self.balance_warning > self.balance_limit:
            reject((("balance_warning",), f"at most balance_limit = {self.balance_limit:g}", self.balance_warning))
        return self


def named_observables(scene: Any) -> list[tuple[tuple[Any, ...], Any]]:
    """Location and name of the fields and quantities that a scene asks for."""
    named: list[tuple[tuple[Any, ...], Any]] = []
    named += [(("output", "fields", i), name) for i, name in enumerate(scene.output.fields or ())]
    for i, probe in enumerate(scene.probes):
        named += [(("probes", i, "fields", k), name) for k, name in enumerate(probe.fields or ())]
        named.append((("probes", i, "quantity"), probe.quantity))
    return named
