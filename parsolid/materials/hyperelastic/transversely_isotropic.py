"""Heart muscle: the transversely isotropic exponential law of Guccione, McCulloch & Waldman."""

from typing import Annotated, NamedTuple

from parsolid.elementary import exp
from parsolid.kernels import inlined
from parsolid.materials.declaration import Density, Direction, Parameter, law
from parsolid.materials.hyperelastic.functions import elastic_moduli, energy, pressure_waves, stress, volume_part
from parsolid.materials.hyperelastic.volume import (
    BulkModulus,
    VolumeKind,
    volume_energy,
    volume_slopes,
    volume_terms,
)
from parsolid.tensors import (
    add_spherical,
    combine,
    combine_symmetric,
    contract_symmetric,
    general,
    gram,
    largest_eigenvalue_bound,
    matmul,
    times_symmetric,
)

FIBRE = Annotated[tuple[float, float, float], Direction("of the fibres")]


@law("hyperelastic", "guccione")
class Guccione(NamedTuple):
    """C/2 [exp(Q) - 1] + U(J), Q = b_f E_ff^2 + b_t (E_ss^2 + E_nn^2 + 2 E_sn^2) + 2 b_fs (E_fs^2 + E_fn^2) of Green's
    strain along fibres f and across (Guccione, McCulloch & Waldman, J. Biomech. Eng. 113 (1991) 42)."""

    density: Density
    stiffness: Annotated[float, Parameter("Pa", "C", above=0.0)]
    along: Annotated[float, Parameter("1", "b_f, along fibres", above=0.0)]
    across: Annotated[float, Parameter("1", "b_t, across them", above=0.0)]
    shear: Annotated[float, Parameter("1", "b_fs, of shear between both", above=0.0)]
    bulk_modulus: BulkModulus
    volume: VolumeKind
    fibre: FIBRE
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None


@inlined
def _strains(law, F):
    """Green's strain E, E a and a.E a of the fibres along a, and Q."""
    E, a = times_symmetric(0.5, add_spherical(gram(F), -1.0)), law.fibre
    x = E[0] * a[0] + E[3] * a[1] + E[4] * a[2]
    y = E[3] * a[0] + E[1] * a[1] + E[5] * a[2]
    z = E[4] * a[0] + E[5] * a[1] + E[2] * a[2]
    along, square = x * a[0] + y * a[1] + z * a[2], x * x + y * y + z * z
    across = contract_symmetric(E, E) - 2.0 * square + along * along
    Q = law.along * along * along + law.across * across + 2.0 * law.shear * (square - along * along)
    return E, (x, y, z), along, Q


@inlined
def _slope_of_Q(law, E, Ea, along):
    """dQ/dE, symmetric."""
    a, mixed = law.fibre, 2.0 * (law.shear - law.across)
    outer = 2.0 * (law.along + law.across - 2.0 * law.shear) * along
    x, y, z = Ea
    of_fibres = (outer * a[0] * a[0] + 2.0 * mixed * a[0] * x, outer * a[1] * a[1] + 2.0 * mixed * a[1] * y,
                 outer * a[2] * a[2] + 2.0 * mixed * a[2] * z, outer * a[0] * a[1] + mixed * (a[0] * y + a[1] * x),
                 outer * a[0] * a[2] + mixed * (a[0] * z + a[2] * x),
                 outer * a[1] * a[2] + mixed * (a[1] * z + a[2] * y))  # fmt: skip
    return combine_symmetric(2.0 * law.across, E, 1.0, of_fibres)


@energy.of(Guccione)
def _energy(law, F, H, J):
    _, _, _, Q = _strains(law, F)
    series = Q * (1.0 + Q * (0.5 + Q * (1.0 / 6.0 + Q * (1.0 / 24.0 + Q / 120.0))))
    return 0.5 * law.stiffness * (series if Q < 1e-3 else exp(Q) - 1.0) + volume_energy(law.volume, law.bulk_modulus, J)


@stress.of(Guccione)
def _stress(law, F, H, J):
    E, Ea, along, Q = _strains(law, F)
    S = times_symmetric(0.5 * law.stiffness * exp(Q), _slope_of_Q(law, E, Ea, along))
    return combine(1.0, matmul(F, general(S)), volume_slopes(law.volume, law.bulk_modulus, J)[0], H)


@pressure_waves.of(Guccione)
def _waves(law, F, H, J):
    # with g = F^T m of the polarisation m and T = sym(g N), Q'' : T T <= 2 b |g|^2, b the largest of the three: at most
    # N.SN + C/2 e^Q [|F Q' N|^2 + 2 b C_max], and U'' of the volume exactly
    E, Ea, along, Q = _strains(law, F)
    slope, grown = _slope_of_Q(law, E, Ea, along), 0.5 * law.stiffness * exp(Q)
    waves = combine_symmetric(grown, slope, grown, gram(matmul(F, general(slope))))
    most = 2.0 * grown * max(law.along, law.across, law.shear) * largest_eigenvalue_bound(gram(F))
    of_volume = max(volume_slopes(law.volume, law.bulk_modulus, J)[1], 0.0)
    return add_spherical(combine_symmetric(1.0, waves, of_volume, gram(H)), most)


@elastic_moduli.of(Guccione)
def _moduli(law):
    # the shear modulus across fibres
    shear = 0.5 * law.stiffness * law.across
    return shear, law.bulk_modulus - 2.0 / 3.0 * shear


volume_part.of(Guccione)(volume_terms)
