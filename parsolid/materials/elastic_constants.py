"""Constants of isotropic linear elasticity."""

from typing import Any, NamedTuple


class ElasticConstants(NamedTuple):
    """Young's modulus, shear modulus, bulk modulus [Pa], Poisson's ratio."""

    youngs_modulus: float
    shear_modulus: float
    bulk_modulus: float
    poissons_ratio: float


def elastic_constants(E: Any, G: Any, nu: Any, K: Any) -> ElasticConstants:
    """All constants from E or G, with nu or K; neither means nu = 0."""
    if K is None:
        nu = nu or 0.0
    elif E is not None:
        nu = 0.5 - E / (6.0 * K)
    else:
        nu = (3.0 * K - 2.0 * G) / (6.0 * K + 2.0 * G)
    E = 2.0 * G * (1.0 + nu) if E is None else E
    return ElasticConstants(E, E / (2.0 * (1.0 + nu)), E / (3.0 * (1.0 - 2.0 * nu)) if K is None else K, nu)
