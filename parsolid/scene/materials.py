"""Tables of materials, chosen by `kind`; a law is declared in a file of `materials` or of the user."""

from collections.abc import Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from parsolid.materials.declaration import SOFTENING, BandWidth, Direction, Phrase, StateVariable, parameters_of
from parsolid.materials.elastic_constants import ElasticConstants, elastic_constants
from parsolid.scene import plasticity  # noqa: F401 (defines the base tables of its roles)
from parsolid.scene.base_model import NotNegative, Positive, SceneModel, dimension_of, reject
from parsolid.scene.declared import DeclaredModel, LibraryTable, laws, stated_sets, table_of
from parsolid.scene.validation_errors import place_in_words

library_of_micro_inertia = partial(
    stated_sets, Path(__file__).parents[1] / "materials" / "plastic" / "micro_inertia.toml"
)
_STATED = "parsolid.materials.plastic.micro_inertia"
_ELASTIC = ("youngs_modulus", "poissons_ratio", "shear_modulus", "bulk_modulus")


@table_of("micro-inertia")
class MicroInertiaSolid(LibraryTable):
    """Solids with micro-inertia, with `library`; elastic constants are all of the library or all of the scene."""

    library: str | None = Field(None, description="a material of the library")

    @classmethod
    def entries(cls) -> dict[str, dict[str, Any]]:
        """Published sets."""
        return library_of_micro_inertia()

    @classmethod
    def taken(cls, known: dict[str, Any], stated: dict[str, Any]) -> dict[str, Any]:
        """The values of the entry, without its elastic constants if the scene states one."""
        if not set(_ELASTIC) & stated.keys():
            return known
        return {key: value for key, value in known.items() if key not in _ELASTIC}

    @model_validator(mode="after")
    def _derived(self) -> "MicroInertiaSolid":
        declared = type(self).declared
        if not issubclass(declared, import_module(_STATED).StatedMicroInertia):
            reject((("law",), "a class derived from StatedMicroInertia", declared.__name__))
        return self

    def build(self, state: str) -> Any:
        """The law, the same in every state of strain."""
        law: Any = self
        return law.micro_inertia_law()


@table_of("prony")
class PronyTable(DeclaredModel):
    """Linear viscoelastic and linear elastic solids."""

    @model_validator(mode="after")
    def _stable(self, info: ValidationInfo) -> "PronyTable":
        stated: Any = self
        reject(*stated.faults_in(dimension_of(info)))
        return self

    def build(self, state: str) -> Any:
        """The law, made for the state of strain."""
        return import_module("parsolid.materials.viscoelastic.prony").of_material(self, state)


@table_of("bond-based")
class BondBasedTable(DeclaredModel):
    """Poisson's ratio is 1/3 in plane stress, 1/4 in plane strain and in space."""

    @property
    def equilibrium(self) -> ElasticConstants:
        """Elastic constants with the Poisson's ratio of space and plane strain."""
        law = self.part_of()
        return elastic_constants(law.youngs_modulus, None, 0.25, None)

    instantaneous: ClassVar[Any] = equilibrium

    def build(self, state: str) -> Any:
        """The law, the same in every state of strain."""
        return self.part_of()


class ValueFault(ValueError):
    """A value that a law cannot have at a particle, with the key of the material, expected and found."""

    def __init__(self, key: str, expected: str, found: str) -> None:
        super().__init__(f"{key}: expected {expected}, found {found}")
        self.place, self.expected, self.found = tuple(key.split(".")), expected, found


class Branch(SceneModel):
    """One Maxwell branch: its stiffness, as a multiple `beta` of the shear modulus or as `modulus`, and `tau`."""

    exactly_one: ClassVar = (("beta", "modulus"),)
    beta: NotNegative | None = Field(None, description="branch modulus over equilibrium shear modulus")
    modulus: NotNegative | None = Field(None, description="the branch modulus [Pa]")
    tau: Positive = Field(description="the relaxation time [s]")


class Softening(SceneModel):
    """Mullins softening by Ogden and Roxburgh: the isochoric stress has the factor 1 - erf[(Wm - W)/(m + beta Wm)]/r,
    with the isochoric energy W below its largest value Wm so far."""

    r: Annotated[float, Field(gt=1)] = Field(description="the smallest factor on the stress is 1 - 1/r")
    m: Positive = Field(description="difference of energies over which a rubber softens [J/m^3]")
    beta: NotNegative = Field(0.0, description="part of this difference that grows with the largest energy")


@table_of("hyperelastic")
class HyperelasticSolid(DeclaredModel):
    """Keys and properties of all hyperelastic laws: Maxwell branches, softening, elastic constants at rest."""

    branches: list[Branch] = []
    softening: Softening | None = None

    @model_validator(mode="after")
    def _softening_without_state(self) -> "HyperelasticSolid":
        if self.softening is not None and self._has_state:
            reject((("softening",), "no such key of a law with state variables of its own", Phrase("a table")))
        return self

    @property
    def ledger_terms(self) -> dict[str, int]:
        """The dissipation of state variables, if there are any."""
        return {SOFTENING: 1} if self.softening is not None or self._has_state else {}

    @property
    def _has_state(self) -> bool:
        """Whether the law has state variables without softening."""
        return any(isinstance(note, StateVariable) for _, note in parameters_of(type(self).declared).values())

    def equilibrium_law(self) -> Any:
        """The law, a NamedTuple, without branches."""
        return self.part_of(branch_moduli=None, relaxation_times=None)

    def build(self, state: str) -> Any:
        """The law, the same in every state of strain."""
        moduli, times = (tuple(map(float, values)) or None for values in (self.branch_moduli, self.relaxation_times))
        law, softening = self.equilibrium_law(), self.softening
        if softening is not None:
            softened = import_module("parsolid.materials.hyperelastic.softening").Softened
            r, m, beta = float(softening.r), float(softening.m), float(softening.beta)
            law = softened(law.density, law, r, m, beta, 0.0, None, None)
        return law._replace(branch_moduli=moduli, relaxation_times=times)

    @property
    def cell_data(self) -> dict[str, tuple[str, int]]:
        """Members of the law that are cell data of the mesh -> name in the mesh file, number of components."""
        result = {}
        for name, (_, note) in parameters_of(type(self).declared).items():
            data = getattr(getattr(self, name, None), "cell_data", None)
            if data is not None:
                result[name] = data, note.components
        return result

    def values_at(
        self, points: np.ndarray, of_cells: dict[str, np.ndarray], bands: np.ndarray | None = None
    ) -> np.ndarray:
        """Values (m, n) of the law that differ between particles, at n points (n, d) [m] and time 0.

        of_cells: member -> `cell_data` (n, components) there; bands (n,) [m]: widths of localisation bands there, see
        `BandWidth`. Raises `ValueFault`.
        """
        members = import_module("parsolid.materials.hyperelastic.at_particles").members(self.build("space"))
        columns = [self._values_of(one.name, one.note, points, of_cells.get(one.name), bands) for one in members]
        return np.concatenate(columns, axis=1).T if columns else np.zeros((0, len(points)))

    def _values_of(
        self, name: str, note: Any, points: np.ndarray, of_cells: np.ndarray | None, bands: np.ndarray | None
    ) -> np.ndarray:
        """Values (n, components) of a member of the law, see `values_at`."""
        stated = None if isinstance(note, StateVariable) else getattr(self, name)
        if stated is None and isinstance(note, BandWidth):
            return self._within_largest(name, points, bands)
        if stated is None:
            # state variables, and directions that may be left out
            return np.tile(note.at_rest, (len(points), 1))
        if name in self.cell_data and of_cells is None:
            raise ValueFault(f"{name}.cell_data", "a formula where there is no mesh", stated.cell_data)
        values = stated.evaluate(points) if of_cells is None else of_cells
        values = values.reshape(len(points), note.components)
        is_direction, length = isinstance(note, Direction), np.linalg.norm(values, axis=1)
        valid = np.isfinite(length) & ((length > 0.0) | (not is_direction))
        if not valid.all():
            where = place_in_words(points[int(np.argmin(valid))])
            expected = "a direction everywhere" if is_direction else "a number everywhere"
            raise ValueFault(name, expected, f"none at ({where})")
        if isinstance(note, BandWidth):
            return self._within_largest(name, points, values[:, 0])
        return values / length[:, None] if is_direction else values

    def _within_largest(self, name: str, points: np.ndarray, bands: np.ndarray | None) -> np.ndarray:
        """Widths of bands (n, 1) from (n,) [m]. Raises `ValueFault` if there are none or one is out of bounds."""
        if bands is None:
            raise ValueFault(name, "a width [m] where there are no particles", "none")
        largest: float = self.largest_band  # type: ignore[attr-defined]
        valid = (bands > 0.0) & (bands < largest)
        if not valid.all():
            worst = int(np.argmin(valid))
            place = place_in_words(points[worst])
            raise ValueFault(name, f"more than 0 and less than {largest:g} m", f"{bands[worst]:g} m at ({place})")
        return bands[:, None]

    def law_at(self, point: Sequence[float]) -> Any:
        """The law at a point (d,) [m] at time 0, without cell data. Raises `ValueFault`."""
        values = self.values_at(np.asarray([point], float), {})
        at_particles = import_module("parsolid.materials.hyperelastic.at_particles")
        return at_particles.at_particle(self.build("space"), values.ravel(), 1, 0)

    @property
    def elastic_moduli(self) -> tuple[float, float]:
        """Shear modulus and first Lame constant [Pa] after relaxation."""
        shear, lame = import_module("parsolid.materials.hyperelastic.functions").elastic_moduli(self.equilibrium_law())
        return shear, lame

    @property
    def equilibrium(self) -> ElasticConstants:
        """Linear elastic constants after relaxation."""
        return self._constants(0.0)

    @property
    def instantaneous(self) -> ElasticConstants:
        """Linear elastic constants before relaxation."""
        return self._constants(sum(self.branch_moduli))

    def _constants(self, added: float) -> ElasticConstants:
        # branches add to the shear modulus, not to the bulk modulus
        shear, lame = self.elastic_moduli
        return elastic_constants(None, shear + added, None, lame + 2.0 / 3.0 * shear + 2.0 / 3.0 * added)

    @property
    def branch_moduli(self) -> tuple[float, ...]:
        """mu_alpha [Pa] of the branches with a modulus above 0."""
        return tuple(modulus for modulus, _ in self._branches())

    @property
    def relaxation_times(self) -> tuple[float, ...]:
        """tau_alpha [s] of the branches with a modulus above 0."""
        return tuple(tau for _, tau in self._branches())

    def _branches(self) -> list[tuple[float, float]]:
        shear = self.elastic_moduli[0]
        moduli = [
            (branch.beta or 0.0) * shear if branch.modulus is None else branch.modulus for branch in self.branches
        ]
        return [(modulus, branch.tau) for modulus, branch in zip(moduli, self.branches) if modulus > 0.0]


ROLES_OF_MATERIALS = ("hyperelastic", "micro-inertia", "prony", "bond-based", "elastic-plastic")
Material: Any = laws(*ROLES_OF_MATERIALS)
