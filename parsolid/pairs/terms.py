"""What acts between two particles beside their stresses, chosen by type, and the named columns of the arrays that the
passes read.

Terms of the divergence pass: None for the stresses alone, `RiemannDissipation`, `MeanRiemann`, `ShearScaled` or
`AlongBonds`. Kernels take them as arguments; columns are constants when a kernel is compiled.

Columns of a matrix stand one after the other, padded to 4 in space; a symmetric tensor stands as its diagonal (11, 22,
33, free) and its off-diagonal part (12, 13, 23, 0) in space, as (11, 22, 12, free) in the plane.
"""

from typing import NamedTuple

from parsolid.numerics.dispatch import constant
from parsolid.numerics.lanes import WIDTH


class LinearReconstruction(NamedTuple):
    """The jump of the velocities without what the mean of both gradients explains; see MUSCL schemes."""

    order: int = 1


class DirectionalShear(NamedTuple):
    """Shear waves whose speed depends on direction: the records hold their tensor, too."""

    waves: int = 2


class RiemannDissipation(NamedTuple):
    """Upwinding of total-Lagrangian SPH, eqs (74), (75) of Lee et al.; the pairs' weights hold its factors.

    reconstruction: `LinearReconstruction` or None; shear: `DirectionalShear` or None.
    """

    reconstruction: LinearReconstruction | None
    shear: DirectionalShear | None


class MeanRiemann(NamedTuple):
    """The same with one impedance of each wave for all directions, see `pairs.mean_impedance`.

    reconstruction: `LinearReconstruction` or None.
    """

    reconstruction: LinearReconstruction | None


class ShearScaled(NamedTuple):
    """Self-adjoint control of zero-energy modes, after Wan et al. with the shear modulus alone as its scale."""

    kind: int = 0


class AlongBonds(NamedTuple):
    """Control of zero-energy modes by eq (39) of Galadima et al.; not the derivative of an energy."""

    kind: int = 1


class Kinematics(NamedTuple):
    """First columns of a particle's vectors: `field` (velocity, or what drives a stress), `position` (or displacement),
    `reference`."""

    field: int
    position: int
    reference: int
    width: int


class StressRecord(NamedTuple):
    """Columns of P L alone [Pa]."""

    stress: int
    width: int


class RiemannRecord(NamedTuple):
    """P L, 1/2 grad v, halves of rho^2 times the wave tensors Q_p and, where shear is directional, Q_s.

    The free lane of Q_p holds 1/2 rho c_s where shear is isotropic.
    """

    stress: int
    gradient: int
    pressure_wave: int
    shear_wave: int
    width: int


class MeanRiemannRecord(NamedTuple):
    """P L, 1/2 grad v, and halves of the impedances of pressure and shear waves, in space in pads of P L."""

    stress: int
    gradient: int
    pressure: int
    shear: int
    width: int


class ShearScaledRecord(NamedTuple):
    """M = S - C1 G, C1; the first `changing` columns are new in every evaluation."""

    stress: int
    stiffness: int
    changing: int
    width: int


class AlongBondsRecord(NamedTuple):
    """M = S, c G, and c in every lane; the first `changing` columns are new in every evaluation."""

    stress: int
    gradient: int
    modulus: int
    changing: int
    width: int


# the field comes first in both
KINEMATICS = {2: Kinematics(0, 2, 4, 8), 3: Kinematics(0, 4, 8, 12)}
# columns that a matrix and a symmetric tensor take
_MATRIX, _SYMMETRIC = {2: 4, 3: 12}, {2: 4, 3: 8}


def _columns(dimension: int, kind: type, directional: bool):
    matrix, tensor = _MATRIX[dimension], _SYMMETRIC[dimension]
    if kind is RiemannDissipation:
        pressure, shear = 2 * matrix, 2 * matrix + tensor
        return RiemannRecord(0, matrix, pressure, shear, shear + (tensor if directional else 0))
    if kind is MeanRiemann:
        first = 2 * matrix if dimension == 2 else WIDTH - 1
        step = 1 if dimension == 2 else WIDTH
        return MeanRiemannRecord(0, matrix, first, first + step, 2 * matrix + (WIDTH if dimension == 2 else 0))
    if kind is ShearScaled:
        return ShearScaledRecord(0, matrix, matrix, 2 * matrix)
    if kind is AlongBonds:
        return AlongBondsRecord(0, matrix, 2 * matrix, 2 * matrix, 2 * matrix + WIDTH)
    return StressRecord(0, matrix)


@constant
def record_columns(space, terms):
    """Columns of what a particle tells its neighbours in the divergence pass; a constant in kernels."""
    directional = isinstance(terms, RiemannDissipation) and terms.shear is not None
    return _columns(dimension_of(space), type(terms), directional)


@constant
def kinematic_columns(space):
    """Columns of a particle's vectors; a constant in kernels."""
    return KINEMATICS[dimension_of(space)]


@constant
def dimension_of(space) -> int:
    """The dimension of a `numerics.layout` space; a constant in kernels."""
    return type(space)._field_defaults["dimension"]


def matrix_columns(dimension: int) -> int:
    """Columns that a matrix takes."""
    return _MATRIX[dimension]
