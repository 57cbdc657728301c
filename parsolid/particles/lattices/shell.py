"""Cylindrical shells and ring sectors on a lattice that follows them."""

import numpy as np

from parsolid.particles.lattices.lattice import Lattice, Line, jitter_offsets
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.bodies import FilledShape


def _circle(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cosine and sine [rad], exactly zero where they vanish, so that particles lie on the planes of symmetry."""
    pair = np.cos(angle), np.sin(angle)
    for values in pair:
        values[np.abs(values) < 1e-15] = 0.0
    return pair


class ShellFilling(Lattice):
    """A cylindrical shell on the lattice (hoop, axial, radial), a ring on (hoop, radial); ids run fastest radially.

    The particle's own axes are its hoop, axial and radial direction. Volumes are r dr dtheta dz with the trapezoid rule
    on nodes, the midpoint rule on cells: both sum to the exact volume. A closed ring has no particle twice.
    """

    def __init__(self, body: FilledShape, dimension: int) -> None:
        shape = body.shape.model
        self.body = body
        self.dimension = dimension
        self.axis, self.origin = shape.normal, np.array(shape.origin, float)
        nodes = body.placed_on == "vertices"
        inner, outer = shape.radius - 0.5 * shape.thickness, shape.radius + 0.5 * shape.thickness
        start, end = np.radians(shape.angles)
        numbers = body.numbers()
        lines = [Line(start, end, numbers[0], nodes, shape.closed)]
        if dimension == 3:
            lines.append(Line(0.0, shape.length, numbers[1], nodes))
        super().__init__([*lines, Line(inner, outer, numbers[-1], nodes)])
        self.lower, self.upper, self.coarsest = body.extent()

    def _place(self, radius: np.ndarray, cosine: np.ndarray, sine: np.ndarray, axial: np.ndarray | float) -> np.ndarray:
        position = np.empty((len(cosine), self.dimension))
        position[:, (self.axis + 1) % 3] = radius * cosine
        position[:, (self.axis + 2) % 3] = radius * sine
        if self.dimension == 3:
            position[:, self.axis] = axial
        return position + self.origin

    def _axes(self, cosine: np.ndarray, sine: np.ndarray) -> np.ndarray:
        axes = np.zeros((len(cosine), self.dimension, self.dimension))
        b, c = (self.axis + 1) % 3, (self.axis + 2) % 3
        axes[:, 0, b], axes[:, 0, c] = -sine, cosine
        axes[:, -1, b], axes[:, -1, c] = cosine, sine
        if self.dimension == 3:
            axes[:, 1, self.axis] = 1.0
        return axes

    def piece(self, first: int, last: int) -> ParticleSet:
        identifier = np.arange(first, last)
        index = self.indices(first, last)
        offset = jitter_offsets(self.body, identifier, self.movable(index), len(self.lines))
        coordinates = [line.coordinate(i, offset[:, k]) for k, (line, i) in enumerate(zip(self.lines, index))]
        weight = [line.weight(i) for line, i in zip(self.lines, index)]
        side = np.stack([line.side(i) for line, i in zip(self.lines, index)], axis=1)
        # volumes and areas are those of the lattice before it was jittered
        radius = self.lines[-1].coordinate(index[-1])
        axial_weight = weight[1] if self.dimension == 3 else np.ones(len(identifier))
        arc = weight[0] * radius
        face_radius = radius if self.lines[-1].nodes else radius + 0.5 * side[:, -1] * weight[-1]
        faces = [weight[-1] * axial_weight, arc * weight[-1], weight[0] * face_radius * axial_weight]
        face = np.stack(faces if self.dimension == 3 else [faces[0], faces[2]], axis=1)
        steps = [radius * self.lines[0].step] + [np.full(len(identifier), line.step) for line in self.lines[1:]]
        cosine, sine = _circle(coordinates[0])
        axes = self._axes(cosine, sine)
        return ParticleSet(
            identifier=identifier,
            position=self._place(coordinates[-1], cosine, sine, coordinates[1]),
            volume=arc * weight[-1] * axial_weight,
            spacing=np.stack(steps, axis=1),
            axes=axes,
            body=np.zeros(len(identifier), np.int32),
            area=np.einsum("nk,nkd->nd", side * face, axes),
        )
