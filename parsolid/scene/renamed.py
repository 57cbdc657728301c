"""Words of earlier versions and what they are called now: keys, kinds and values of scenes, columns of the history."""

# old word -> new ones, of which a message names those that are known where the old one stands
RENAMED: dict[str, tuple[str, ...]] = {
    # keys
    "heated": ("thermal_reference",),
    "pair_correction": ("weights",),
    "cost": ("core_seconds",),
    "yardstick": ("other_code",),
    # kinds and values
    "micro_clamped": ("micro-hard",),
    "heat_flux": ("heat-flux",),
    "surface_pressure": ("pressure",),
    "nodes": ("vertices",),
    # columns of history.csv
    "stored": ("strain_energy", "internal_energy"),
    "dissipation_internal": ("material_dissipation",),
    "dissipation_numerical": ("numerical_dissipation",),
    "dissipation_fracture": ("fracture_dissipation",),
    "work_external": ("external_work",),
    "work_fixed_walls": ("fixed_wall_work",),
    "deleted_stored": ("deleted_internal_energy",),
    "leapfrog_oscillation": ("kinetic_offset",),
    "contact_oscillation": ("kinetic_offset",),
    "balance": ("energy_error",),
    # fields and quantities
    "deviator_norm": ("von_mises_stress",),
    "maximum_deviator_norm": ("maximum_von_mises_stress",),
    # measures of a study
    "internal_dissipation": ("material_dissipation",),
}
