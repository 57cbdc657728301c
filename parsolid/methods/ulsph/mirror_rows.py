"""Rows of mirror images, which sweeps read like those of particles."""

import numpy as np

from parsolid.pairs.verlet_list import VerletList


class MirrorRows:
    """The rows of a list's images, made from the rows of the particles that they mirror.

    Velocities are v' = Q v + 2 w and positions x' as in `MirrorCodes`. P' = Q P R, so that the power of the forces is
    that of the stresses on the rates. Fluxes, and P in the weights of pairs, are reflected.

    first: row of the first image; unlike (codes,): where Q differs from R, so that images do not move as reflections.
    """

    def __init__(self, pairs: VerletList, reference_position: np.ndarray) -> None:
        """reference_position (rows, d) [m]: of owned particles and ghosts."""
        assert pairs.images is not None
        self.first, d = reference_position.shape
        self.codes, self.source, self.code = pairs.codes, pairs.images.source, pairs.images.code
        codes, images, self._stride = pairs.codes, len(self.source), 2 if d == 2 else 4
        Q, R, D = (array[self.code, :d] for array in (codes.signs, codes.reflections, codes.drifts))
        self.unlike = (codes.signs != codes.reflections).any(axis=1)
        self._carried = (R - D) * reference_position[self.source] if codes.carried else np.zeros((images, d))
        self._motion, self._shift = np.ones((images, 8)), np.zeros((images, 8))
        self._motion[:, :d], self._motion[:, self._stride : self._stride + d] = Q, D
        self._record, self._flux = np.ones((images, 4 * self._stride)), np.ones((images, 2 * self._stride))
        for j in range(d):
            self._record[:, self._stride * j : self._stride * j + d] = Q * R[:, j : j + 1]
        self._flux[:, : 2 * d] = np.repeat(R, 2, axis=1)
        self._tension = np.ones((images, 8 if d == 3 else 4))
        for column, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)) if d == 3 else ((0, 1),)):
            self._tension[:, d + column] = R[:, i] * R[:, j]
        self._follow_planes()

    def _follow_planes(self) -> None:
        """Velocities and shifts of the planes in their present places."""
        d = self._carried.shape[1]
        self._shift[:, :d] = self.codes.velocities[self.code, :d]
        self._shift[:, self._stride : self._stride + d] = self.codes.shifts[self.code, :d] + self._carried

    def fill_motion(self, motion: np.ndarray, flux: np.ndarray | None) -> None:
        """Images in rows of motion, and of fluxes where there are any."""
        if self.codes.moving:
            self._follow_planes()
        motion[self.first :] = self._motion * motion[self.source] + self._shift
        if flux is not None:
            flux[self.first :] = self._flux * flux[self.source]

    def fill_record(self, record: np.ndarray) -> None:
        """Images in rows of stresses."""
        record[self.first :] = self._record * record[self.source]

    def fill_tension(self, tension: np.ndarray) -> None:
        """Images in rows of tension: a pair and its image have the same weight."""
        tension[self.first :] = self._tension * tension[self.source]
