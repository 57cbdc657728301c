"""Material points of one rank: the container of their fields, and the particles of a
`decomposition.RankGrid` at once.
"""

from typing import Any

import numpy as np

from parsolid.materials.blocks import MaterialBlock, block_numbers, blocks_between
from parsolid.materials.registry import laws_of
from parsolid.methods.failed_matter import failed_to_delete, note_deleted
from parsolid.methods.failure_fields import DELETED_KINETIC, DELETED_STORED
from parsolid.methods.mpm import weights as grid_weights
from parsolid.methods.mpm.grid import AffineFlip, Apic, Flip, Taylor
from parsolid.numerics.lanes import aligned_zeros
from parsolid.numerics.layout import LAYOUT
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field, Rows, Within
from parsolid.particles.extents import domain_bounds
from parsolid.particles.generated import declare_generated
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene

# F of the undeformed body: 11, 12, 21, 22, 33 in two dimensions, its rows in three
_IDENTITY = {2: (1.0, 0.0, 0.0, 1.0, 1.0), 3: (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)}


VelocityTransfer = Flip | Apic | AffineFlip | Taylor
# transfers that take the nodes' velocities themselves
_AFFINE: dict[str, type[Apic] | type[Taylor]] = {"apic": Apic, "tpic": Taylor}


class MaterialPoints(Particles):
    """What all particles carry, see `methods.mpm.grid` for the records; laws declare what theirs carry besides.

    origin (4,) [m]: of the grid; where: name of the record whose first columns are the places [m] that weights belong
    to.
    """

    def __init__(self, scene: Scene, particle_set: ParticleSet):
        """particle_set: this rank's particles, sorted by law."""
        laws = laws_of(scene)
        self.laws, law_of_body = block_numbers(laws, np.arange(len(laws)))
        super().__init__(particle_set.body, law_of_body)
        self.settings, self.dimension = scene.method, particle_set.position.shape[1]
        self.origin = aligned_zeros(4)
        if scene.method.origin is not None:
            self.origin[: self.dimension] = scene.method.origin
        self.axisymmetric = scene.method.geometry == "axisymmetric"
        # material kernels see the plane's layout in axisymmetry, too: l33 and F33 are there
        self.space = LAYOUT[self.dimension]
        self.where = "reference_position" if scene.method.formulation == "total-lagrangian" else "motion"
        place = Rows(4) if self.where == "reference_position" else Rows()
        declare_generated(self, particle_set, reference_position=place)
        self._declare_motion(particle_set)
        kinds = {boundary.kind for boundary in scene.boundaries}
        self._declare_transfer(particle_set, "velocity" in kinds, "heat_flux" in kinds)
        self._bases = np.empty((0, self.dimension), np.int64)
        self._base_offset = grid_weights.base_offset(self.basis)

    def _declare_motion(self, particles: ParticleSet) -> None:
        """The record of motion, deformation and stress."""
        d, density = self.dimension, np.array([law.density for law in self.laws])[self.law_of_body[particles.body]]
        volume = particles.volume * (particles.position[:, 0] if self.axisymmetric else 1.0)
        self.declare(Field("motion", 8, "m kg m/s m^3"))
        position = Field("position", d, "m", checkpointed=True, shown=True, layout=Within("motion", 0))
        self.declare(position, particles.position)
        self.declare(Field("mass", 1, "kg", layout=Within("motion", 3)), volume * density)
        self.declare(Field("velocity", d, "m/s", checkpointed=True, shown=True, layout=Within("motion", 4)))
        self.declare(Field("grid_volume", 1, "m^3", layout=Within("motion", 7)), volume)
        F = _IDENTITY[d]
        self.declare(Field("deformation_gradient", len(F), "1", checkpointed=True, layout=Columns(), padding=F), F)
        self.declare(Field("velocity_gradient", 12, "1/s"))
        self.declare(Field("stress_and_volume", 8, "J", checkpointed=True))

    def _declare_transfer(self, particles: ParticleSet, driven: bool, heated: bool) -> None:
        """What only some settings need."""
        settings, d = self.settings, self.dimension
        if settings.formulation == "total-lagrangian":
            self.declare(Field("nominal_stress_and_volume", 12, "J"))
        # FLIP has slopes beside driven nodes alone: see `transfers.UpdateStressLast`
        if settings.transfer != "flip" or driven:
            self.declare(Field("velocity_slope", 12, "1/s", checkpointed=True))
        # see `HeatedSurfaces`
        if heated:
            self.declare(Field("temperature_slope", 4, "K/m", checkpointed=True))
        if settings.basis in ("ugimp", "cpgimp"):
            # cells of a particle's own axes count as boxes along the grid
            halves = np.full((len(particles), 4), 0.5)
            halves[:, :d] = 0.5 * particles.spacing / settings.cell
            self.declare(Field("half_widths", 4, "1"), np.minimum(halves, 0.5) if settings.basis == "ugimp" else halves)

    # --- as kernels take them -------------------------------------------------------------------------------------

    def find(self, name: str) -> np.ndarray | None:
        """The storage of a field that not every scene has."""
        return self.storage(name) if name in self else None

    @property
    def motion(self) -> np.ndarray:
        """(capacity, 8): x y z m | vx vy vz V0."""
        return self.storage("motion")

    @property
    def places(self) -> np.ndarray:
        """Places (capacity, 4 or 8) [m] that the weights belong to, in the first columns."""
        return self.storage(self.where)

    @property
    def basis(self) -> Any:
        """The grid's basis, on the particles' half widths where it needs them."""
        return grid_weights.make_basis(self.settings.basis, self.find("half_widths"))

    @property
    def velocity_transfer(self) -> VelocityTransfer:
        """How particles take velocities from the nodes, one of `grid`."""
        fraction, slope = float(self.settings.flip_fraction), self.find("velocity_slope")
        if slope is None:
            return Flip(fraction)
        if self.settings.transfer in _AFFINE:
            return _AFFINE[self.settings.transfer](slope)
        return AffineFlip(slope, fraction)

    @property
    def blocks(self) -> list[MaterialBlock]:
        """Particles that share a law, law after law."""
        return blocks_between(self.bounds, self.laws)

    @property
    def warm_blocks(self) -> list[MaterialBlock]:
        """Those whose particles have a temperature."""
        return [block for block in self.blocks if hasattr(block.law, "specific_heat")]

    # --- as the particles of a RankGrid ---------------------------------------------------------------------------

    def bases(self) -> np.ndarray:
        """Base node (capacity, d) of each particle at its present place."""
        if len(self._bases) < self.capacity:
            self._bases = np.empty((self.capacity, self.dimension), np.int64)
        inverse = 1.0 / self.settings.cell
        grid_weights.find_bases(0, self.owned, self.places, self.origin, inverse, self._base_offset, self._bases)
        return self._bases

    def names(self) -> np.ndarray:
        """Global numbers of the particles."""
        return self.storage("identifier")

    def stretch_domains(self) -> None:
        """Half widths of convected particles along the grid, from the diagonal of F; others have none that change."""
        if self.settings.basis == "cpgimp":
            d, rows = self.dimension, [0, 3] if self.dimension == 2 else [0, 4, 8]
            stretch = self.storage("deformation_gradient")[rows, : self.owned].T
            spacing = self.storage("spacing")[: self.owned]
            self.storage("half_widths")[: self.owned, :d] = 0.5 / self.settings.cell * spacing * stretch

    # --- what fails -----------------------------------------------------------------------------------------------

    def delete_failed(self) -> dict[str, float]:
        """Take away what has failed since the last time, where laws say so: energies [J] that go with it."""
        rows = failed_to_delete(self, self.blocks)
        if not len(rows):
            return {}
        mass, velocity = self.motion[rows, 3].copy(), self.owned_rows("velocity")[rows]
        stored = float(self["internal_energy"][rows] @ self.motion[rows, 7])
        kinetic = note_deleted(self, rows, mass, velocity)
        self.without_deleted()
        return {DELETED_KINETIC: kinetic, DELETED_STORED: stored}

    def without_deleted(self) -> None:
        """Give deleted particles no mass and no volume, so that no node knows of them; they go on as tracers."""
        if "deleted_mass" in self:
            gone = self.owned_rows("deleted_mass") > 0.0
            self.motion[: self.owned][gone, 3] = self.motion[: self.owned][gone, 7] = 0.0
            self.storage("stress_and_volume")[: self.owned][gone, :7] = 0.0

    def take_heat(self, heat: np.ndarray, rows: np.ndarray) -> float:
        """Warm rows (n,) by heat (n,) [J], which their internal energy holds; what they took [J]. Particles without a
        temperature take none, nor do deleted ones."""
        taken = 0.0
        for block in self.warm_blocks:
            chosen = (rows >= block.first) & (rows < block.last) & (self.motion[rows, 3] > 0.0)
            here = rows[chosen]
            density = heat[chosen] / self.motion[here, 7]
            temperature = self.owned_rows("temperature")
            capacity = block.law.density * block.law.specific_heat_at(temperature[here])
            # as `materials.plastic.specific_heat.temperature_rise`
            grows = 2.0 * block.law.density * block.law.specific_heat_slope * density
            temperature[here] += 2.0 * density / (capacity + np.sqrt(capacity * capacity + grows))
            self.owned_rows("internal_energy")[here] += density
            taken += float(heat[chosen].sum())
        return taken

    # --- what follows from the fields -------------------------------------------------------------------------------

    def deformation_gradients(self, first: int, last: int) -> np.ndarray:
        """F (n, 3, 3)."""
        components = self["deformation_gradient"][first:last]
        if self.dimension == 3:
            return np.ascontiguousarray(components).reshape(-1, 3, 3)
        result = np.zeros((len(components), 3, 3))
        result[:, :2, :2], result[:, 2, 2] = components[:, :4].reshape(-1, 2, 2), components[:, 4]
        return result

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
