"""Material points of one rank: their fields, and their state at time 0."""

from typing import Any

import numpy as np

from parsolid.kernels import kernel
from parsolid.materials.blocks import MaterialBlock, block_numbers, blocks_between
from parsolid.materials.registry import laws_of
from parsolid.methods.failed_matter import declare_failure, failed_to_delete, note_deleted
from parsolid.methods.failure_fields import DELETED_INTERNAL, DELETED_KINETIC, kept_column
from parsolid.methods.hyperelastic_particles import (
    declare_deformation,
    deformation_at_start,
    full_gradients,
    gradient_of,
)
from parsolid.methods.mpm.shape_functions import make_basis
from parsolid.methods.plastic_fields import PLASTIC_STATE, declare_flow_state
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field, Within
from parsolid.particles.extents import domain_bounds
from parsolid.particles.generated import declare_generated
from parsolid.particles.initial_fields import (
    initial_displacement,
    initial_plastic_strain,
    initial_temperature,
    initial_velocity,
    initial_zero_energy_temperature,
)
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene

# components of six that the deviator has in two and three dimensions
SYMMETRIC_ROWS = {2: 4, 3: 6}


@kernel
def find_base_nodes(count, position, origin, spacing, offset, base):
    """Base nodes of particles 0..count-1, base[p, a] = floor((x_a - origin_a)/h - offset).

    position (capacity, >= d) [m]; origin (>= d,) [m]; base (capacity, d) of whole numbers.
    """
    inverse = 1.0 / spacing
    for p in range(count):
        for a in range(base.shape[1]):
            base[p, a] = np.floor((position[p, a] - origin[a]) * inverse - offset)


class MaterialPoints(Particles):
    """Material points, in the records of `transfer`.

    Also the particles of a `decomposition.grid.RankGrid`. origin (4,) [m]: of the grid; fraction: of FLIP in new
    velocities.
    """

    def __init__(self, scene: Scene, particle_set: ParticleSet):
        """particle_set: this rank's particles, sorted by law."""
        laws = laws_of(scene)
        self.laws, law_of_body = block_numbers(laws, np.arange(len(laws)))
        super().__init__(particle_set.body, law_of_body)
        self.settings, self.dimension = scene.method, particle_set.position.shape[1]
        self.axisymmetric = scene.method.geometry == "axisymmetric"
        self.fraction = 0.0 if scene.method.transfer == "apic" else float(scene.method.flip_fraction)
        self.origin = np.zeros(4)
        if scene.method.origin is not None:
            self.origin[: self.dimension] = scene.method.origin
        declare_generated(self, particle_set)
        d, density = self.dimension, np.array([law.density for law in self.laws])[self.law_of_body[particle_set.body]]
        volume = particle_set.volume * (particle_set.position[:, 0] if self.axisymmetric else 1.0)
        self.declare(Field("motion", 8, "m kg m/s m^3"))
        position = Field("position", d, "m", checkpointed=True, shown=True, layout=Within("motion", 0))
        self.declare(position, particle_set.position)
        self.declare(Field("mass", 1, "kg", layout=Within("motion", 3)), volume * density)
        self.declare(Field("velocity", d, "m/s", checkpointed=True, shown=True, layout=Within("motion", 4)))
        self.declare(Field("grid_volume", 1, "m^3", layout=Within("motion", 7)), volume)
        declare_deformation(self, d, self.laws)
        self.declare(Field("velocity_gradient", 12, "1/s"))
        self.declare(Field("stress_and_volume", 8, "J", checkpointed=True))
        # fields that only some settings and boundaries need
        boundaries = {boundary.kind for boundary in scene.boundaries}
        settings, d = self.settings, self.dimension
        # FLIP has slopes beside driven nodes alone, see `conditions.GridConditions.keep_slopes_beside_driven`
        if settings.transfer != "flip" or "velocity" in boundaries:
            self.declare(Field("velocity_slope", 12, "1/s", checkpointed=True))
        # see `heat.heat_to_grid`
        if "heat-flux" in boundaries:
            self.declare(Field("temperature_slope", 4, "K/m", checkpointed=True))
        if settings.basis == "ugimp":
            # cells of a particle's own axes count as boxes along the grid
            halves = np.full((len(particle_set), 4), 0.5)
            halves[:, :d] = np.minimum(0.5 * particle_set.spacing / settings.cell, 0.5)
            self.declare(Field("half_widths", 4, "1", padding=(0.5,) * 4), halves)
        self._bases = np.empty((0, self.dimension), np.int64)

    def begin(self, scene: Scene, particle_set: ParticleSet) -> None:
        """Velocity, position, F, and slopes of the velocity if there are any, at time 0 by the bodies' formulas.

        The slopes are those at the present places; slopes of a body at rest would smooth its first step.
        """
        d, place = self.dimension, (scene, particle_set.body, particle_set.position, particle_set.regions)
        rows = self.owned_rows
        rows("velocity")[:] = initial_velocity(*place)
        displacement, cell = initial_displacement(*place), scene.method.cell
        F = deformation_at_start(scene, particle_set, cell)
        if displacement is not None:
            rows("position")[:] += displacement
        rows("deformation_gradient")[:, : d * d] = F.reshape(-1, d * d)
        if "velocity_slope" in self:
            slope = gradient_of(initial_velocity, scene, particle_set, cell) @ np.linalg.inv(F)
            rows("velocity_slope").reshape(-1, 3, 4)[:, :d, :d] = slope
        if self.axisymmetric:
            rows("deformation_gradient")[:, 4] = rows("position")[:, 0] / particle_set.position[:, 0]

    def declare_plastic_state(self) -> None:
        """Declare the fields of elastic-plastic laws."""
        self.declare(kept_column("unrotated_deviator", SYMMETRIC_ROWS[self.dimension], "Pa"))
        for field in PLASTIC_STATE:
            self.declare(field)
        declare_flow_state(self, self.laws, SYMMETRIC_ROWS[self.dimension])
        declare_failure(self, self.laws)

    def begin_plastic_state(self, scene: Scene, particle_set: ParticleSet) -> None:
        """Temperatures of the bodies' formulas and the internal energy that belongs to them."""
        rows, place = self.owned_rows, (scene, particle_set.body, particle_set.position)
        laws = [self.laws[number] for number in self.law_of_body]
        usual = np.array([getattr(law, "reference_temperature", 0.0) for law in laws])
        rows("temperature")[:] = initial_temperature(*place, usual, particle_set.regions)
        rows("plastic_strain")[:] = initial_plastic_strain(*place, particle_set.regions)
        for block in self.warm_blocks:
            here = slice(block.first, block.last)
            warm, reference = rows("temperature")[here], block.law.reference_temperature
            cold = initial_zero_energy_temperature(scene, rows("body")[here], warm, reference)
            rows("internal_energy")[here] = block.law.internal_energy(warm, cold)

    # --- as kernels take them -------------------------------------------------------------------------------------

    def find(self, name: str) -> np.ndarray | None:
        """The storage of a field that not every scene has."""
        return self.storage(name) if name in self else None

    @property
    def motion(self) -> np.ndarray:
        """(capacity, 8), see `transfer`."""
        return self.storage("motion")

    @property
    def basis(self) -> Any:
        """The grid's shape functions."""
        return make_basis(self.settings.basis, self.find("half_widths"))

    @property
    def blocks(self) -> list[MaterialBlock]:
        return blocks_between(self.bounds, self.laws)

    @property
    def warm_blocks(self) -> list[MaterialBlock]:
        """Blocks whose particles have a temperature."""
        return [block for block in self.blocks if hasattr(block.law, "specific_heat")]

    def bases(self) -> np.ndarray:
        """Base node (capacity, d) of each particle at its present place."""
        if len(self._bases) < self.capacity:
            self._bases = np.empty((self.capacity, self.dimension), np.int64)
        offset = self.basis.offset
        find_base_nodes(self.owned, self.motion, self.origin, float(self.settings.cell), offset, self._bases)
        return self._bases

    # --- what fails, and heat ---------------------------------------------------------------------------------------

    def delete_failed(self) -> dict[str, float]:
        """Delete particles that have failed, where laws say so: the energies [J] that they had."""
        rows = failed_to_delete(self, self.blocks)
        if not len(rows):
            return {}
        mass, velocity = self.motion[rows, 3].copy(), self.owned_rows("velocity")[rows]
        stored = float(self["internal_energy"][rows] @ self.motion[rows, 7])
        kinetic = note_deleted(self, rows, mass, velocity)
        self.without_deleted()
        return {DELETED_KINETIC: kinetic, DELETED_INTERNAL: stored}

    def without_deleted(self) -> None:
        """Set mass and volume of deleted particles to 0, so that nodes get nothing from them. They stay as tracers."""
        if "deleted_mass" in self:
            gone = self.owned_rows("deleted_mass") > 0.0
            self.motion[: self.owned][gone, 3] = self.motion[: self.owned][gone, 7] = 0.0
            self.storage("stress_and_volume")[: self.owned][gone, :7] = 0.0

    def take_heat(self, heat: np.ndarray, rows: np.ndarray) -> float:
        """Warm rows (n,) by heat (n,) [J], which adds to their internal energy; the heat taken [J]. Particles without a
        temperature and deleted ones take none."""
        taken = 0.0
        for block in self.warm_blocks:
            chosen = (rows >= block.first) & (rows < block.last) & (self.motion[rows, 3] > 0.0)
            here = rows[chosen]
            density = heat[chosen] / self.motion[here, 7]
            temperature = self.owned_rows("temperature")
            temperature[here] += block.law.temperature_rise(temperature[here], density)
            self.owned_rows("internal_energy")[here] += density
            taken += float(heat[chosen].sum())
        return taken

    # --- what follows from the fields -------------------------------------------------------------------------------

    def deformation_gradients(self, first: int, last: int) -> np.ndarray:
        """F (n, 3, 3)."""
        return full_gradients(self, self.dimension, first, last)

    def jacobian(self, first: int, last: int) -> np.ndarray:
        """det F (n,)."""
        return np.asarray(np.linalg.det(self.deformation_gradients(first, last)))

    def bounds_of_domains(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds (d,) [m] of the deformed domains of this rank's particles."""
        d, rows = self.dimension, self.owned_rows
        axes = rows("axes").reshape(-1, d, d) if "axes" in self else None
        return domain_bounds(rows("position"), self.deformation_gradients(0, self.owned), rows("spacing"), axes)

    def entropy(self) -> float:
        """m eta [J/K] of this rank's particles."""
        total = 0.0
        for block in self.warm_blocks:
            here = slice(block.first, block.last)
            eta = block.law.entropy(self["temperature"][here], self.jacobian(block.first, block.last))
            total += float(self.motion[here, 3] @ eta)
        return total

    def heat(self) -> float:
        """m int_0^T C_v dT [J] of this rank's particles."""
        total = 0.0
        for block in self.warm_blocks:
            here = slice(block.first, block.last)
            total += float(self.motion[here, 3] @ block.law.heat(self["temperature"][here]))
        return total
