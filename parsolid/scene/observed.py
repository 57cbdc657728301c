"""Names of what every method lets a scene watch: fields of particles and quantities of all of them, with their kinds.

`parsolid.observables` computes them. "rotation": about the axis out of the plane in 2-D, a vector in space.
"""

# Cauchy stress at the nodes of meshes, and its von Mises stress; of particles that are no such nodes their own
NODAL_STRESS, NODAL_VON_MISES = "nodal_stress", "nodal_von_mises_stress"
# in the order in which they are written
FIELDS = {
    "displacement": "vector",
    "velocity": "vector",
    "position": "vector",
    "deformation_gradient": "tensor",
    "stress": "tensor",
    "first_piola_kirchhoff_stress": "tensor",
    "pressure": "scalar",
    "von_mises_stress": "scalar",
    NODAL_STRESS: "tensor",
    NODAL_VON_MISES: "scalar",
    "jacobian": "scalar",
    "rank": "scalar",
    "error_indicator": "scalar",
}
# fields that are written unless a scene chooses, and those that no probe takes
USUAL_FIELDS = ("displacement", "velocity", "pressure", "von_mises_stress", "jacobian")
NOT_PROBED = ("rank", "error_indicator")
# of scenes with [[contact]] between particles
FIELDS_OF_CONTACT = {"contact_force": "vector"}
# fields of a probe at a particle that need more than the present state
FIELDS_OF_PROBES = {"twist": "scalar"}
QUANTITIES = {
    "minimum_jacobian": "scalar",
    "maximum_speed": "scalar",
    "linear_momentum": "vector",
    "angular_momentum": "rotation",
    "centre_of_mass": "vector",
}


def probed_fields() -> dict[str, str]:
    """Name -> kind of the fields that probes at a particle take."""
    common = {name: kind for name, kind in FIELDS.items() if name not in NOT_PROBED}
    return common | FIELDS_OF_CONTACT | FIELDS_OF_PROBES


def components_of(name: str, kind: str, dimension: int) -> list[str]:
    """The history's names of a field's or quantity's components: itself, with _x..., or with _xx, _xy... row by row."""
    axes = "xyz"[:dimension]
    if kind == "scalar" or (kind == "rotation" and dimension == 2):
        return [name]
    if kind == "tensor":
        return [f"{name}_{row}{column}" for row in axes for column in axes]
    return [f"{name}_{axis}" for axis in axes]


def with_components(kinds: dict[str, str], dimension: int) -> dict[str, str]:
    """Name -> kind of fields, and of their components by the history's names of these."""
    several = [(name, kind) for name, kind in kinds.items() if kind in ("vector", "tensor")]
    return dict.fromkeys((part for one in several for part in components_of(*one, dimension)), "scalar") | kinds
