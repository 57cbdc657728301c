"""Names and kinds of the fields of particles and the quantities of all particles that every method has.

`parsolid.observables` computes them. Kind "rotation": about the axis out of the plane in 2-D, a vector in 3-D.
"""

# Cauchy stress at nodes of meshes, and its von Mises stress; other particles have their own stress
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
# default fields of the output, and fields that probes do not accept
USUAL_FIELDS = ("displacement", "velocity", "pressure", "von_mises_stress", "jacobian")
NOT_PROBED = ("rank", "error_indicator")
# fields of scenes with [[contact]] between particles
FIELDS_OF_CONTACT = {"contact_force": "vector"}
# fields of probes only, which depend on the history
FIELDS_OF_PROBES = {"twist": "scalar"}
QUANTITIES = {
    "minimum_jacobian": "scalar",
    "maximum_speed": "scalar",
    "linear_momentum": "vector",
    "angular_momentum": "rotation",
    "centre_of_mass": "vector",
}


def probed_fields() -> dict[str, str]:
    """Name -> kind of the fields that probes accept."""
    common = {name: kind for name, kind in FIELDS.items() if name not in NOT_PROBED}
    return common | FIELDS_OF_CONTACT | FIELDS_OF_PROBES


def components_of(name: str, kind: str, dimension: int) -> list[str]:
    """Names of the components of a field or quantity: name, name_x..., or name_xx, name_xy... row by row."""
    axes = "xyz"[:dimension]
    if kind == "scalar" or (kind == "rotation" and dimension == 2):
        return [name]
    if kind == "tensor":
        return [f"{name}_{row}{column}" for row in axes for column in axes]
    return [f"{name}_{axis}" for axis in axes]


def with_components(kinds: dict[str, str], dimension: int) -> dict[str, str]:
    """Name -> kind of fields and of the components of vectors and tensors."""
    result: dict[str, str] = {}
    for name, kind in kinds.items():
        if kind in ("vector", "tensor"):
            result |= dict.fromkeys(components_of(name, kind, dimension), "scalar")
    return result | kinds
