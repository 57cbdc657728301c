"""Material points of one rank: their arrays, laws, fields, state at time 0, energies, and what is shown of them."""

import numpy as np

from parsolid.materials.blocks import MaterialBlock, block_numbers
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.plastic_evaluation import melting_temperature
from parsolid.materials.registry import laws_of
from parsolid.methods.mpm import weights as grid_weights
from parsolid.methods.mpm.heat import note_plastic_rise
from parsolid.methods.mpm.hyperelastic_update import advance_elastic_stress, elastic_energy
from parsolid.methods.mpm.particle_store import ParticleStore
from parsolid.methods.mpm.plastic_update import (
    DEFORMATION_ROWS,
    DEVIATOR_ROWS,
    BulkViscosity,
    MaterialState,
    advance_stress,
)
from parsolid.methods.mpm.reference_grid import reference_rows
from parsolid.methods.tlsph.stresses import as_matrices
from parsolid.numerics.layout import LAYOUT
from parsolid.particles.extents import domain_bounds
from parsolid.particles.fields import Field, FieldTable
from parsolid.scene import initial_deformation_gradient, initial_displacement, initial_temperature, initial_velocity

# of the cell, for the gradient of an initial displacement
_DIFFERENCE = 1e-4


class MaterialPoints:
    """What particles carry, see `methods.mpm.grid` and `plastic_update` for the layouts; `table` shows it to others.

    Also the particles of a `decomposition.RankGrid`.
    """

    def __init__(self, scene, particle_set, origin: np.ndarray):
        """particle_set: this rank's particles, sorted by law; origin (4,) [m] of the grid."""
        self.settings, self.dimension, self.origin = scene.method, particle_set.position.shape[1], origin
        self.axisymmetric = scene.method.geometry == "axisymmetric"
        laws = laws_of(scene)
        self.laws, law_of_body = block_numbers(laws, np.arange(len(laws)))
        self.plastic = any(isinstance(law, ElasticPlastic) for law in self.laws)
        # material kernels see the plane's layout in axisymmetry, too: l33 and F33 are there
        self.space = LAYOUT[self.dimension]
        # planes at a temperature take up the plastic heat of the particles beside them, see `Conduction`
        self._held = any(boundary.kind == "temperature" for boundary in scene.boundaries)
        viscosity = scene.method.viscosity
        self.viscosity = BulkViscosity(float(viscosity.linear), float(viscosity.quadratic), float(scene.method.cell))
        self.store = ParticleStore(law_of_body, particle_set.body)
        self._fill(particle_set)
        self.table = FieldTable(self.owned)
        self._fields = self._declared()
        self._seen = (-1, -1)
        self.refresh()

    def _fill(self, particle_set) -> None:
        d, add, n = self.dimension, self.store.add, self.owned
        add("identifier", particle_set.identifier)
        add("reference_position", particle_set.position)
        add("volume", particle_set.volume)
        add("spacing", particle_set.spacing)
        if particle_set.axes is not None:
            add("axes", particle_set.axes.reshape(n, d * d))
        add("area", particle_set.area)
        motion = np.zeros((n, 8))
        motion[:, :d] = particle_set.position
        motion[:, 7] = particle_set.volume * (particle_set.position[:, 0] if self.axisymmetric else 1.0)
        motion[:, 3] = (
            motion[:, 7] * np.array([law.density for law in self.laws])[self.store.law_of_body[particle_set.body]]
        )
        add("motion", motion)
        add("rate", np.zeros((n, 12)))
        add("stress", np.zeros((n, 8)))
        if self.settings.formulation == "total-lagrangian":
            add("reference", reference_rows(particle_set.position))
            add("nominal", np.zeros((n, 12)))
        if self.settings.transfer == "apic":
            add("affine", np.zeros((n, 12)))
        if self.settings.basis in ("ugimp", "cpgimp"):
            # cells of a particle's own axes count as boxes along the grid
            halves = np.full((n, 4), 0.5)
            halves[:, :d] = 0.5 * particle_set.spacing / self.settings.cell
            add("halves", np.minimum(halves, 0.5) if self.settings.basis == "ugimp" else halves)
        self.store.add_columns("deformation", DEFORMATION_ROWS[d])
        self.store["deformation"][[0, 3, 4] if d == 2 else [0, 4, 8]] = 1.0
        if self.plastic:
            self.store.add_columns("deviator", DEVIATOR_ROWS[d])
            for name in ("plastic_strain", "internal_energy", "temperature"):
                self.store.add_columns(name, 1)
            if self.settings.conduction and self._held:
                self.store.add_columns("plastic_rise", 1)

    def _declared(self) -> list[tuple[Field, str, slice | int | None]]:
        """Fields with the array each is in and the columns of it."""
        d, kept = self.dimension, {"checkpointed": True}
        moving = {"evolved": True, "checkpointed": True}
        result = [(Field(name, 1, "1", shown=True, **kept), name, None) for name in ("identifier", "body")]
        result.append((Field("reference_position", d, "m", **kept), "reference_position", None))
        result.append((Field("volume", 1, "m^3", **kept), "volume", None))
        result.append((Field("spacing", d, "m", **kept), "spacing", None))
        if "axes" in self.store.arrays:
            result.append((Field("axes", d * d, "1", **kept), "axes", None))
        result.append((Field("area", d, "m^2", **kept), "area", None))
        result.append((Field("velocity", d, "m/s", shown=True, **moving), "motion", slice(4, 4 + d)))
        result.append((Field("position", d, "m", shown=True, **moving), "motion", slice(0, d)))
        if "affine" in self.store.arrays:
            result.append((Field("velocity_slope", 12, "1/s", **moving), "affine", None))
        result.append((Field("deformation_gradient", DEFORMATION_ROWS[d], "1", **moving), "deformation", None))
        result.append((Field("stress_and_volume", 8, "J", **moving), "stress", None))
        if self.plastic:
            result.append((Field("unrotated_deviator", DEVIATOR_ROWS[d], "Pa", **moving), "deviator", None))
            for name, unit in (("plastic_strain", "1"), ("internal_energy", "J/m^3"), ("temperature", "K")):
                result.append((Field(name, 1, unit, **moving), name, 0))
        if "plastic_rise" in self.store.arrays:
            result.append((Field("plastic_rise", 1, "K", **moving), "plastic_rise", 0))
        return result

    def refresh(self) -> None:
        """Follow the store after particles have come, gone or moved."""
        if self._seen == (self.store.changes, self.store.growths):
            return
        if self._seen[1] != self.store.growths:
            for field, name, columns in self._fields:
                array = self.store.by_particle(name)
                self.table.add(field, array if columns is None else array[:, columns])
            arrays = self.store.arrays
            self.motion, self.rate, self.stress = arrays["motion"], arrays["rate"], arrays["stress"]
            # places that the weights belong to
            self.where = arrays.get("reference", self.motion)
            self.bases_array = np.empty((self.store.capacity, self.dimension), np.int64)
            self.state = None
            if self.plastic:
                names = ("deformation", "deviator", "plastic_strain", "internal_energy", "temperature")
                self.state = MaterialState(*(arrays[name] for name in names))
        bounds = self.store.bounds
        self.blocks = [MaterialBlock(int(a), int(b), law) for a, b, law in zip(bounds, bounds[1:], self.laws) if b > a]
        self.table.owned = self.owned
        self.table.layout += 1
        self._seen = (self.store.changes, self.store.growths)

    # --- as the particles of a RankGrid ---------------------------------------------------------------------------

    @property
    def owned(self) -> int:
        """Number of particles."""
        return self.store.owned

    def bases(self) -> np.ndarray:
        """Base node (capacity, d) of each particle at its present place."""
        self.refresh()
        grid_weights.find_bases(
            0, self.owned, self.where, self.origin, 1.0 / self.settings.cell, self.base_offset, self.bases_array
        )
        return self.bases_array

    def names(self) -> np.ndarray:
        """Global numbers of the particles."""
        return self.store["identifier"]

    def packed(self, rows: np.ndarray) -> np.ndarray:
        """See `ParticleStore.packed`."""
        return self.store.packed(rows)

    def insert(self, packed: np.ndarray) -> None:
        """Take in particles."""
        if len(packed):
            self.store.insert(packed)
            self.refresh()

    def remove(self, rows: np.ndarray) -> None:
        """Forget particles."""
        if len(rows):
            self.store.remove(rows)
            self.refresh()

    # --- state --------------------------------------------------------------------------------------------------

    def begin(self, scene, particle_set) -> None:
        """The state at time 0 by the bodies' formulas."""
        d, place = self.dimension, (scene, particle_set.body, particle_set.position)
        rows = self.table.owned_rows
        rows("velocity")[:] = initial_velocity(*place)
        displacement, given = initial_displacement(*place), initial_deformation_gradient(*place)
        F = np.tile(np.eye(d), (self.owned, 1, 1))
        if displacement is not None:
            rows("position")[:] += displacement
            F += self._displacement_gradient(scene, particle_set)
        if given is not None:
            gradient, where = given
            F[where] = gradient[where]
        rows("deformation_gradient")[:, : d * d] = F.reshape(-1, d * d)
        if d == 2 and self.axisymmetric:
            rows("deformation_gradient")[:, 4] = rows("position")[:, 0] / particle_set.position[:, 0]
        if self.plastic:
            laws = [self.laws[number] for number in self.store.law_of_body]
            usual = [law.reference_temperature if isinstance(law, ElasticPlastic) else 0.0 for law in laws]
            rows("temperature")[:] = initial_temperature(*place, np.array(usual))
            for block in self.plastic_groups():
                here = slice(block.first, block.last)
                rows("internal_energy")[here] = block.law.internal_energy(rows("temperature")[here])

    def _displacement_gradient(self, scene, particle_set) -> np.ndarray:
        """(n, d, d) of the bodies' formulas by central differences."""
        small = _DIFFERENCE * self.settings.cell
        columns = []
        for step in small * np.eye(self.dimension):
            ahead, behind = (
                initial_displacement(scene, particle_set.body, particle_set.position + s * step) for s in (1.0, -1.0)
            )
            columns.append((ahead - behind) / (2.0 * small))
        return np.stack(columns, axis=2)

    def plastic_groups(self) -> list[MaterialBlock]:
        """Groups of elastic-plastic particles."""
        return [block for block in self.blocks if isinstance(block.law, ElasticPlastic)]

    def advance_stress(self, step: float) -> tuple[bool, float, float, float]:
        """Deformation, state and stress of all particles after a step [s] with the rates that they have.

        Returns whether all are sound, the largest c + |v| [m/s], plastic and viscous work [J] of this rank.
        """
        sound, fastest, plastic, viscous = True, 0.0, 0.0, 0.0
        for block in self.blocks:
            first, last, law = block.first, block.last, block.law
            if isinstance(law, ElasticPlastic):
                good, speed, work, friction = self._advance_plastic(block, step)
                plastic, viscous = plastic + work, viscous + friction
            else:
                good, speed = advance_elastic_stress(
                    self.space, first, last, law, step, self.store["deformation"], self.motion, self.rate, self.stress
                )
            sound, fastest = sound and good, max(fastest, speed)
        return sound, fastest, plastic, viscous

    def _advance_plastic(self, block: MaterialBlock, step: float) -> tuple[bool, float, float, float]:
        first, last, law, state, rise = (
            block.first,
            block.last,
            block.law,
            self.state,
            self.store.arrays.get("plastic_rise"),
        )
        before = None if rise is None else state.plastic_strain[0].copy()
        result = advance_stress(
            self.space, first, last, law, step, self.viscosity, state, self.motion, self.rate, self.stress
        )
        if rise is not None:
            heating = law.taylor_quinney / (law.density * law.specific_heat)
            note_plastic_rise(
                first, last, self.space, heating, state.deformation, state.deviator, state.plastic_strain, before, rise
            )
        return result

    def stretch_domains(self) -> None:
        """Half widths of convected particles along the grid, from the diagonal of F."""
        d, rows = self.dimension, [0, 3] if self.dimension == 2 else [0, 4, 8]
        stretch = self.store["deformation"][rows, : self.owned].T
        self.store["halves"][: self.owned, :d] = (
            0.5 / self.settings.cell * self.store["spacing"][: self.owned] * stretch
        )

    def stored_energy(self) -> float:
        """Internal energy [J] of this rank's particles."""
        energy = 0.0
        for block in self.blocks:
            here = slice(block.first, block.last)
            if isinstance(block.law, ElasticPlastic):
                energy += float(self.store["internal_energy"][0, here] @ self.motion[here, 7])
            else:
                energy += elastic_energy(
                    self.space, block.first, block.last, block.law, self.store["deformation"], self.motion
                )
        return energy

    # --- what is shown ------------------------------------------------------------------------------------------

    def deformation_gradients(self, first: int, last: int) -> np.ndarray:
        """F (n, 3, 3)."""
        return as_matrices(np.ascontiguousarray(self.store["deformation"][:, first:last].T))

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """See `protocol.ParticleMethod.shown`."""
        here = slice(first, last)
        if name == "deformation_gradient":
            return self.deformation_gradients(first, last)
        if name == "velocity_gradient":
            return self.rate[here].reshape(-1, 3, 4)[:, :, :3].copy()
        if name == "density":
            return self.motion[here, 3] / (self.motion[here, 7] * self.jacobian(first, last))
        if name == "stress":
            xx, yy, zz, _, yz, xz, xy, _ = self.stress[here].T
            volumes = self.motion[here, 7] * self.jacobian(first, last)
            return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1) / volumes[:, None, None]
        return None

    def jacobian(self, first: int, last: int) -> np.ndarray:
        """det F (n,)."""
        return np.linalg.det(self.deformation_gradients(first, last))

    def heat(self) -> float:
        """m C_v T [J] of this rank's elastic-plastic particles."""
        total = 0.0
        for block in self.plastic_groups():
            here = slice(block.first, block.last)
            total += block.law.specific_heat * float(self.motion[here, 3] @ self.store["temperature"][0, here])
        return total

    @property
    def can_melt(self) -> bool:
        """Whether a law has a melting temperature; the same on all ranks."""
        return any(getattr(law, "melting", None) is not None for law in self.laws)

    def homologous_temperatures(self) -> np.ndarray:
        """T / T_m of this rank's particles that can melt."""
        parts = [np.zeros(0)]
        for block in self.plastic_groups():
            if block.law.melting is not None:
                temperature = self.store["temperature"][0, block.first : block.last]
                parts.append(temperature / melting_temperature(block.law, self.jacobian(block.first, block.last)))
        return np.concatenate(parts)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds (d,) [m] of the deformed domains of this rank's particles."""
        d, rows = self.dimension, self.table.owned_rows
        axes = rows("axes").reshape(-1, d, d) if "axes" in self.store.arrays else None
        return domain_bounds(rows("position"), self.deformation_gradients(0, self.owned), rows("spacing"), axes)
