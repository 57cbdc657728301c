"""Values and slopes at nodes from values around them, by least squares over patches.

The patch of a node is what shares an element with it, or what does with that, too. The quadratic function of the place
that fits the values there best gives those at the node: for values that belong to places beside nodes, as stresses do,
superconvergent patch recovery (Zienkiewicz and Zhu, Int. J. Numer. Meth. Eng. 33 (1992) 1331), for values at nodes the
recovery of gradients by Zhang and Naga (SIAM J. Sci. Comput. 26 (2005) 1192). Beyond a plane of symmetry the patch goes
on as its mirror image.
"""

from itertools import product
from typing import Any

import numpy as np
from scipy import sparse

# nodes that are fitted together
_TOGETHER = 512
# a value counts 1/(this + r^2) at the part r of the patch's size
_NEAR = 0.15
# penalty of curvatures over the sum of weights, so that they vanish where the values do not determine them; the values
# of any element determine slopes
_RIDGE = 1e-5


def monomials(place: np.ndarray) -> np.ndarray:
    """1, x, y, (z), x^2, xy, ... (..., k) of places (..., d)."""
    d = place.shape[-1]
    first, second = np.triu_indices(d)
    return np.concatenate([np.ones((*place.shape[:-1], 1)), place, place[..., first] * place[..., second]], axis=-1)


class Patches:
    """Patches of the nodes that a rank knows, in rows.

    near (rows, rows): which nodes share an element, each with itself; nodes (rows, d) [m]; mirrored (rows, d): along
    which axes a plane of symmetry ends the body at a node.
    """

    def __init__(self, near: sparse.csr_matrix, nodes: np.ndarray, mirrored: np.ndarray) -> None:
        self.near, self.nodes, self.mirrored = near, nodes, mirrored
        self._wide: Any = None

    def weights(
        self, rows: np.ndarray, places: np.ndarray, signs: np.ndarray, wide: bool, slopes: bool = False
    ) -> list[sparse.csr_matrix]:
        """Matrices (k, rows) by which values at places (rows, d) [m] give that at the node of each of some rows (k,),
        or their slopes along each axis.

        signs (d,): 1 or -1, of the value's mirror image along each axis; wide: patches of two layers of elements.
        """
        d = self.nodes.shape[1]
        kinds, kind = np.unique(self.mirrored[rows], axis=0, return_inverse=True)
        of, index, found = [np.zeros(0, int)], [np.zeros(0, int)], [np.zeros((0, d if slopes else 1))]
        for number, axes in enumerate(kinds):
            own = np.flatnonzero(kind.ravel() == number)
            images = np.array(list(product(*[(1.0, -1.0) if one else (1.0,) for one in axes])))
            for first in range(0, len(own), _TOGETHER):
                part = own[first : first + _TOGETHER]
                member, there = self._members(rows[part], wide)
                weight = self._fit(rows[part], member, there, places, images, signs, slopes)
                of.append(np.repeat(part, there.sum(axis=1)))
                index.append(member[there])
                found.append(weight[there])
        place = np.concatenate(of), np.concatenate(index)
        shape = len(rows), len(self.nodes)
        return [sparse.csr_matrix((values, place), shape) for values in np.concatenate(found).T]

    def _members(self, rows: np.ndarray, wide: bool) -> tuple[np.ndarray, np.ndarray]:
        """Rows (n, p) of each patch, and which of these are there."""
        reached = self.near[rows] @ self.near if wide else self.near[rows]
        count = np.diff(reached.indptr)
        there = np.arange(count.max(initial=1)) < count[:, None]
        member = np.zeros(there.shape, np.int64)
        member[there] = reached.indices
        return member, there

    def _fit(
        self, rows: np.ndarray, member: np.ndarray, there: np.ndarray, places: np.ndarray, images: np.ndarray,
        signs: np.ndarray, slopes: bool,
    ) -> np.ndarray:  # fmt: skip
        """Weights (n, p, 1 or d) of the members of patches; images (m, d): signs of the axes in each image."""
        node, d = self.nodes[rows][:, None], self.nodes.shape[1]
        size = np.sqrt((((self.nodes[member] - node) ** 2).sum(axis=2) * there).max(axis=1))[:, None, None]
        place = (places[member] - node) / size
        counts = there / (_NEAR + (place**2).sum(axis=2))
        k = 1 + d + d * (d + 1) // 2
        normal, right = np.zeros((len(rows), k, k)), np.zeros((*member.shape, k))
        for image in images:
            Q = monomials(place * image)
            weighted = Q * counts[:, :, None]
            normal += weighted.swapaxes(1, 2) @ Q
            right += np.prod(np.where(image < 0.0, signs, 1.0)) * weighted
        ridge = np.where(np.arange(k) > d, _RIDGE, 0.0)
        normal += np.eye(k) * ridge * (len(images) * counts.sum(axis=1))[:, None, None]
        solution = right @ np.linalg.inv(normal)
        return solution[:, :, 1 : 1 + d] / size if slopes else solution[:, :, :1]
