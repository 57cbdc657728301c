"""Weights of differences along the axes of a box of nodes, of second order or of fourth.

Along one axis with nodes i, lengths H_i [m] and antisymmetric numbers q_ij = -q_ji,

    (grad v)_i = sum_j q_ij (v_j - v_i) / H_i,      (div P)_i = sum_j q_ij (P_j + P_i) / H_i

are a gradient that is exact for linear fields and minus its adjoint, with the norm sum_i H_i v_i w_i: the stress does
exactly the work that the stored energy takes up, and free faces need no treatment. In a box the operators of the axes
are combined by their products: the volume of a node is the product of its lengths. The numbers are those of
summation-by-parts operators: of second order (the cells between the nodes, 1/2 for neighbours), or of fourth order
inside and of second at the ends (Strand, Summation by parts for finite difference approximations for d/dx, J. Comput.
Phys. 110, 1994). What the ends change of the inside adds up where they overlap, on axes of 4 to 7 nodes: the conditions
are linear, so that gradients of quadratic fields stay exact.

Where nodes lie on a mirror plane the box goes on beyond it as its image. Images are folded into the weights: the value
at an image is that at its node times a parity, so that the sums need only the nodes of the box.
"""

from typing import NamedTuple

import numpy as np

# steps to the farthest neighbour along an axis, at the ends of fourth order; inside it is two
REACH = 3
# nodes that an axis needs for both ends of the operator of fourth order; where distances differ or there are images,
# those counted, twice as many: their ends must not meet
FEWEST = 4
# lengths over the step, and q_ij for i < j, at a lower end of fourth order; q_ij by j - i inside
_END_LENGTHS = np.array([17.0, 59.0, 43.0, 49.0]) / 48.0
_INSIDE = {1: 2.0 / 3.0, 2: -1.0 / 12.0}
_AT_END = {(0, 1): 59 / 96, (0, 2): -1 / 12, (0, 3): -1 / 32, (1, 2): 59 / 96, (1, 3): 0.0, (2, 3): 59 / 96}


class Axis(NamedTuple):
    """Nodes along an axis of a box.

    step: their (mean) distance [m]; places: of the nodes, in steps, where their distances differ; mirrors: the kind of
    the mirror plane through the nodes at the lower and the upper end, "roller" or "antisymmetric", empty where there is
    none; held: whether all nodes at an end stand still.
    """

    nodes: int
    step: float
    mirrors: tuple[str, str] = ("", "")
    places: tuple[float, ...] = ()
    held: tuple[bool, bool] = (False, False)

    @property
    def with_images(self) -> int:
        """Nodes with those beyond mirror planes."""
        return self.nodes + (self.nodes - 1) * sum(map(bool, self.mirrors))

    @property
    def has_room(self) -> bool:
        """Whether the operator of fourth order fits."""
        return self.with_images >= (2 * FEWEST if self.places or any(self.mirrors) else FEWEST)

    @property
    def whole(self) -> "Axis":
        """The axis with its nodes beyond mirror planes, in units of the step."""
        places = np.array(self.places)
        if self.places and self.mirrors[0]:
            places = np.concatenate((2.0 * places[0] - places[:0:-1], places))
        if self.places and self.mirrors[1]:
            first = np.array(self.places)
            places = np.concatenate((places, 2.0 * first[-1] - first[-2::-1]))
        held = self.held if not any(self.mirrors) else (False, False)
        return Axis(self.with_images, 1.0, ("", ""), tuple(places.tolist()), held)

    def undamped(self, fourth_order: bool) -> np.ndarray:
        """True (nodes - 1,) for pairs of a node and the next without dissipation of reconstructed jumps.

        On graded axes of fourth order the outermost pairs at ends without images: the gradients there change so fast
        that reconstructed jumps would feed waves.
        """
        result = np.zeros(self.nodes - 1, bool)
        if self.places and fourth_order:
            result[0], result[-1] = result[0] or not self.mirrors[0], result[-1] or not self.mirrors[1]
        return result


class AxisTables(NamedTuple):
    """Tables for the sums along an axis of n nodes.

    gradient, divergence (2, 7, n) [1/m]: of the neighbours -3 .. 3, for components across the axis (first index 0) and
    along it (1), which images mirror differently. jump (2, 2, n) [1/m]: what a node gets of the flux to the node above
    (second index 0) and of that from the node below (1). half_step (n,) [m]: half the distance to the node above, 0
    where jumps are not reconstructed. length (n,) [m]: H_i, whole on mirror planes.
    """

    gradient: np.ndarray
    divergence: np.ndarray
    jump: np.ndarray
    half_step: np.ndarray
    length: np.ndarray


def axis_tables(axis: Axis, fourth_order: bool, dissipation: float, reconstruction: bool) -> AxisTables:
    """Tables of an axis; dissipation: factor on the fluxes; reconstruction: whether jumps are reconstructed."""
    n, q, length = axis.nodes, operator_of(axis, fourth_order), lengths_of(axis, fourth_order)
    gradient, divergence, jump = np.zeros((2, 2 * REACH + 1, n)), np.zeros((2, 2 * REACH + 1, n)), np.zeros((2, 2, n))
    for i in range(n):
        for offset in range(-REACH, REACH + 1):
            weight, j = q[i, REACH + offset], i + offset
            # s: parity of a velocity at the neighbour, t: of columns of the stress
            s, t = np.ones(2), np.ones(2)
            if not 0 <= j <= n - 1:
                j, mirror = (-j, axis.mirrors[0]) if j < 0 else (2 * (n - 1) - j, axis.mirrors[1])
                s = np.array([1.0, -1.0]) * (1.0 if mirror == "roller" else -1.0)
                t = -s
            if weight != 0.0:
                gradient[:, REACH + j - i, i] += s * weight
                gradient[:, REACH, i] -= weight
                divergence[:, REACH + j - i, i] += t * weight
                divergence[:, REACH, i] += weight
            if weight != 0.0 and abs(offset) == 1:
                if j == i + offset:
                    jump[:, 0 if offset > 0 else 1, i] += weight
                else:
                    # the flux to an image is s times minus that to its node on the other side
                    jump[:, 0 if offset < 0 else 1, i] -= s * weight
    if reconstruction:
        pairs = axis.undamped(fourth_order)
        jump[:, 0, :-1][:, pairs] = 0.0
        jump[:, 1, 1:][:, pairs] = 0.0
    places = np.array(axis.places) if axis.places else np.arange(float(n))
    half_step = np.append(0.5 * axis.step * np.diff(places), 0.0) if reconstruction else np.zeros(n)
    return AxisTables(gradient / length, divergence / length, dissipation * jump / length, half_step, length)


def lengths_of(axis: Axis, fourth_order: bool) -> np.ndarray:
    """H_i (n,) [m], where distances differ sum_j q_ij X_j, so that gradients of linear fields are exact."""
    if not axis.places:
        end = _END_LENGTHS if fourth_order else np.array([0.5])
        norm = np.ones(axis.nodes)
        if not axis.mirrors[0]:
            norm[: len(end)] += end - 1.0
        if not axis.mirrors[1]:
            norm[axis.nodes - len(end) :] += end[::-1] - 1.0
        return norm * axis.step
    places, operator = np.array(axis.places), operator_of(axis, fourth_order)
    # images, as far as there are nodes for them; operators reach no farther
    inner = places[1 : 1 + REACH], places[-2 : -2 - REACH : -1]
    room = [(REACH - len(one), 0) for one in inner]
    images = [np.pad(2.0 * end - one[::-1], width) for one, end, width in zip(inner, places[[0, -1]], room)]
    line = np.concatenate((images[0], places, images[1][::-1]))
    return np.array([operator[i] @ (line[i : i + 2 * REACH + 1] - places[i]) for i in range(axis.nodes)]) * axis.step


def shares_of(axis: Axis) -> np.ndarray:
    """The part (n,) of a node's length on this side of mirror planes."""
    share = np.ones(axis.nodes)
    share[0] *= 0.5 if axis.mirrors[0] else 1.0
    share[-1] *= 0.5 if axis.mirrors[1] else 1.0
    return share


def operator_of(axis: Axis, fourth_order: bool) -> np.ndarray:
    """q (n, 7) by node and offset, images included."""
    n, q = axis.nodes, np.zeros((axis.nodes, 2 * REACH + 1))
    for offset, weight in (_INSIDE if fourth_order else {1: 0.5}).items():
        q[:, REACH + offset], q[:, REACH - offset] = weight, -weight
    for i in range(n):
        for j in range(i - REACH, i + REACH + 1):
            if (j < 0 and not axis.mirrors[0]) or (j >= n and not axis.mirrors[1]):
                q[i, REACH + j - i] = 0.0
    if fourth_order:
        for (i, j), weight in _AT_END.items():
            change = weight - _INSIDE.get(j - i, 0.0)
            ends = [(i, j)] * (not axis.mirrors[0]) + [(n - 1 - j, n - 1 - i)] * (not axis.mirrors[1])
            for a, b in ends:
                q[a, REACH + b - a] += change
                q[b, REACH + a - b] -= change
    return q
