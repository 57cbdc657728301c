"""Base class of the settings of all methods."""

from collections.abc import Iterable
from math import inf
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from parsolid.scene.base_model import Detail, Name, NotNegative, OnRestart, Positive, SceneModel, reject
from parsolid.scene.codes import Note


class ArtificialViscosity(SceneModel):
    """Bulk viscosity in compression, q = rho h |tr d| (quadratic h |tr d| + linear c), with the cell size or particle
    spacing h; its work becomes internal energy.
    """

    linear: NotNegative = Field(0.2, description="factor of the sound speed")
    quadratic: NotNegative = Field(2.0, description="factor of the velocity jump over a cell or spacing")


# the stable step grows by its root; weights (gravity), heat capacities and flow rates do not change
MassScaling = Annotated[
    float | None,
    Field(
        gt=1,
        le=1e8,
        description="factor on the inertial mass in slow (quasi-static) motions, whose steps become longer by its "
        "root; weights do not change",
    ),
]

# excess of the kinetic energy at the ends of leapfrog steps over the conserved one, see `methods.leapfrog`
KINETIC_OFFSET = "kinetic_offset"
# kinetic energy that is lost where a stage of equilibria begins
STAGE_CHANGE = "stage_change"

# name -> kind of the fields that particles of every method have
COMMON_FIELDS = {"mass": "scalar", "share": "scalar", "spacing": "vector", "reference_position": "vector"}


class MethodSettings(SceneModel):
    """Keys of all methods, and properties of a method that other tables of a scene are checked against.

    system                  module and class, "module:class"
    dimensions, materials   accepted dimensions and roles of laws
    boundaries              accepted kinds of boundaries; refused: reason, or alternative, for other kinds
    prescribes              motion that can be prescribed: "velocity", "displacement"
    reactions               kinds of boundaries that can report their force
    pressed                 keys of the places that a pressure may have
    loads                   accepted keys of the table `loads`
    declared_fields         fields of particles that a scene may name besides `COMMON_FIELDS`
    extra_fields            other fields, name -> "scalar", "vector" or "tensor"
    extra_quantities        quantities of all particles, name -> kind
    pictured_fields         fields that colour pictures: the first one that was written
    ledger_terms            see `ledger.Ledger`; viscous_terms: those of artificial viscosity, where a scene has them
    shared_field            bodies share a velocity field and stick together; bodies in contact become several systems
    in_cells                particles of lattices are at centres of cells, never on the boundary
    strained                an initial displacement from results is a strain
    initial_stress_refused  why an initial stress is refused, or None
    stage_keys              keys that a stage of a run may change, see `scene.systems.Stage`

    State that another run may start from, as names of declared fields (* for any end):

    state_variables         state variables, besides the positions
    state_of_particles      those that are taken only by identical particles
    state_forces            further fields taken if all particles are identical, otherwise computed again
    contact_variables       fields of contact and tools, taken by identical particles if results have them
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
    name: Name | None = Field(None, description="the name, by which bodies refer to one of several methods")
    maximum_step: Positive | None = Field(None, description="the largest time step [s]")
    minimum_step: Positive | None = Field(None, description="the time step [s] below which the run stops")
    substeps: Annotated[int, Field(ge=1, le=64)] | Literal["auto"] | None = Field(
        None, description="steps of this method within a common step of several methods: a number, or 'auto'"
    )
    balance_warning: Positive = Field(0.01, description='energy error over largest energy of an "unbalanced" run')
    balance_limit: Positive = Field(0.05, description="energy error over the largest energy at which a run fails")
    dissipation_warning: Positive = Field(
        0.1, description='numerical dissipation over the energy input above which a run is "dissipative"'
    )

    @property
    def inertia_factor(self) -> float:
        """The inertial mass over the mass."""
        return getattr(self, "mass_scaling", None) or 1.0

    def faults_of_scaling(self, scene: Any, refused: str | None) -> list[Detail]:
        """The fault of a `mass_scaling` without effect or meaning; refused: the reason of the method, or None."""
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
        """`ledger_terms` of the method and of the materials of its bodies (indices in the scene)."""
        terms = dict(self.ledger_terms)
        for i in bodies:
            terms |= getattr(scene.bodies[i].material, "ledger_terms", {})
        return terms

    def scene_faults(self, scene: Any) -> list[Detail]:
        """Faults (location, expected, found) between the method and other tables of a scene."""
        return []

    def defaults_for(self, scene: Any, bodies: Iterable[int]) -> dict[str, Any]:
        """Defaults of keys that depend on the scene and the bodies and differ from those of the class."""
        return {}

    def with_defaults(self, values: dict[str, Any]) -> Self:
        """A copy with values of keys that still count as not stated by the scene."""
        result = self.model_copy(update=values)
        result.__pydantic_fields_set__.intersection_update(self.model_fields_set)
        return result

    def in_stage(self, stated: dict[str, Any]) -> Self:
        """The settings of a stage: its keys, defaults for other `stage_keys`, and the rest of these settings.

        Raises ValidationError.
        """
        values = {key: getattr(self, key) for key in type(self).model_fields if key not in self.stage_keys}
        kept = {key: value for key, value in values.items() if key in self.model_fields_set}
        return type(self).model_validate(kept | stated).with_defaults(values)

    def notes(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        """Notes on settings of a scene that cost accuracy and can be avoided."""
        return []

    def without_state(self, name: str) -> str:
        """A setting, in words, with which a field of the state that results lack is not needed."""
        return ""

    def ignored_keys(self, scene: Any, bodies: Iterable[int]) -> frozenset[str]:
        """Keys of the method without effect on these bodies."""
        return frozenset()

    def choices(self, scene: Any, bodies: Iterable[int]) -> list[Note]:
        """Notes for `check` on settings that the method chose because the scene does not state them."""
        return []

    def touching(self) -> str:
        """The behaviour, in words, of touching bodies of the method without a contact."""
        return "bonded where they touch"

    def band(self, spacing: np.ndarray) -> np.ndarray:
        """Width (n,) [m] of the band in which strain localises, for particles with a spacing (n, d) [m].

        Two spacings, over which gradients are differences; measured on a breaking neck (docs/laws.md).
        """
        return np.asarray(2.0 * np.prod(spacing, axis=1) ** (1.0 / spacing.shape[1]))

    def reach(self, spacing: np.ndarray) -> np.ndarray:
        """Semi-axes (d,) [m] of the region in which particles with a spacing (d,) [m] act on others."""
        return np.zeros_like(spacing)

    def contact_distance(self, spacing: np.ndarray) -> np.ndarray:
        """Semi-axes (d,) [m] within which particles of two bodies with a spacing (d,) [m] are in contact."""
        return spacing

    def largest_spacing(self) -> float | None:
        """The largest particle spacing [m] that the method accepts, or None."""
        return None

    def bending_fault(self, across: int, spacing: float) -> tuple[str, bool] | None:
        """Why slender bodies with `across` particles of a spacing [m] across bend wrongly, and whether a run is
        inapplicable for it; None if they do not."""
        return None

    def bonding(self, scene: Any, bodies: Iterable[int]) -> list[bool]:
        """For each body whether the method bonds it to others where they touch."""
        return [True for _ in bodies]

    def bonded_spacings(self, scene: Any) -> float:
        """Largest ratio of the spacings of two bonded bodies."""
        return inf

    def warned_bonded_spacings(self, scene: Any) -> float:
        """Ratio of the spacings of two bonded bodies above which a run warns that the bond is too soft."""
        return inf

    def bonded_moduli(self, scene: Any) -> float:
        """Largest ratio of the P-wave moduli of two bonded bodies."""
        return inf

    def contact_refused(self, scene: Any) -> str | None:
        """Why bodies of the method cannot be in contact, or None if they can."""
        return "with this method"

    def tie_refused(self, scene: Any) -> str | None:
        """Why bodies of the method cannot be tied, or None if they can."""
        return self.contact_refused(scene)

    def substeps_refused(self) -> str | None:
        """Why the method cannot take several steps within a common one, or None if it can."""
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
    """Location and name of all fields and quantities in the output and probes of a scene."""
    named: list[tuple[tuple[Any, ...], Any]] = []
    named += [(("output", "fields", i), name) for i, name in enumerate(scene.output.fields or ())]
    for i, probe in enumerate(scene.probes):
        named += [(("probes", i, "fields", k), name) for k, name in enumerate(probe.fields or ())]
        named.append((("probes", i, "quantity"), probe.quantity))
    return named
