"""Codes of faults, warnings, notes and of the energy check, with meanings and remedies.

Codes never change; the page of codes in the manual is made from these tables.
"""

from typing import NamedTuple


class Code(NamedTuple):
    """The meaning of a code, and a remedy."""

    says: str
    remedy: str


FAULTS = {
    "unknown-key": Code("a key that the table does not have", "the suggested one, or one of `parsolid keys TABLE`"),
    "missing": Code("a required key, or one of several keys, is missing", "state it"),
    "exclusive": Code("keys that exclude each other, or none of them", "keep one of them"),
    "type": Code("a value of another type", "state what is expected: a number, a text, a list, a table, true or false"),
    "bound": Code("a number outside of its bounds, or not finite", "a number within the bounds"),
    "length": Code("a list that is too long or too short", "as many entries as are expected, often one per dimension"),
    "choice": Code("an unknown word", "the suggested one, or another of the list"),
    "formula": Code("a faulty formula", "use X, Y, Z, t and the functions of docs/parts.md"),
    "file": Code("a file that does not exist or cannot be read", "paths are relative to the folder of the scene"),
    "method": Code("a kind that the method of the scene or body does not accept", "another kind, or another method"),
    "unknown-name": Code("an unknown body, region, field or column", "the suggested one, or declare it"),
    "repeated": Code("a repeated name or entry", "rename or remove one"),
    "contradiction": Code(
        "conditions that prescribe different values of a component for the same particles",
        "take the particles out of one of the regions, or leave the component 'free' there",
    ),
    "touching": Code(
        "touching bodies that no table names, or a bond of bodies that do not touch",
        "`[[contact]]`, `[[tie]]` or `[[bond]]`, see docs/contact.md",
    ),
    "elsewhere": Code("a plane or a point without a body", "check coordinates and units (SI)"),
    "geometry": Code("geometry that Gmsh cannot mesh", "install `parsolid[cad]`, state `size`, or repair the file"),
    "element": Code("inverted or flat elements of a mesh", "repair the mesh there"),
    "double-node": Code("unconnected nodes of a mesh at one position", "merge them, or make two bodies"),
    "hanging-node": Code("nodes of a mesh inside facets or edges of other elements", "split the elements there"),
    "edge-contact": Code("parts of a mesh that share only an edge, or in 2-D a node", "join or separate them there"),
    "self-overlap": Code("overlapping elements of a mesh", "repair the mesh there"),
    "open-surface": Code("a surface of triangles with open edges", "close it, or mesh its volume"),
    "refused": Code("a value that other keys of the scene exclude", "the message says what is expected"),
}

WARNINGS = {
    "badly-held": Code(
        "a plane at rest by `velocity` in `mpm`, with linear weights, or neither on nodes nor half-way between",
        "`roller` or `fixed` on nodes or half-way between (`method.origin`)",
    ),
    "cell-below-spacing": Code(
        "cells of `mpm` smaller than the spacing: particles separate freely", "cells of two spacings (`method.cell`)"
    ),
    "friction-of-rattling-bodies": Code(
        "friction between bodies without damping, which may lag behind the motion",
        "let loads grow slowly, or give one body a method or a material with damping",
    ),
    "unlike-axes-in-contact": Code(
        "spacings of a body in contact that differ along its axes by more than 1.25 (more than 1.5 is refused)",
        "like spacings along all axes",
    ),
    "unlike-axes-in-tie": Code(
        "spacings of a tied body that differ along its axes by more than 1.25: the springs are too stiff or too soft",
        "like spacings along all axes",
    ),
    "unlike-bonded-spacings": Code(
        "bonded bodies of peridynamics whose spacings differ by more than 1.25: the bond is too soft",
        "like spacings, finer ones, or a `[[tie]]` of two `[[methods]]`",
    ),
    "undeclared-contact": Code('bodies that met without a contact (`undeclared_contact = "warn"`)', "`[[contact]]`"),
    "one-layer": Code("a single layer of particles across a free body", "two layers or more, or plane strain"),
    "too-stiff": Code(
        "bodies with a Poisson's ratio above .45 without pressures as unknowns: meshes in motion, boxes in equilibrium",
        "a body from a mesh in equilibria and long steps (`method.integrator`); a finer mesh in motion",
    ),
    "wall-bears-early": Code(
        "a wall of `mpm` that bears a body from the start across a gap of less than 1.2 cells", "smaller cells"
    ),
    "wrong-bending": Code(
        "slender bodies that bend wrongly: in `mpm` mostly too stiff, with the transfer `flip`; in `ulsph` too soft",
        '`mpm`: `transfer = "apic"`, or four points across and two a cell and direction; `ulsph`: eight across',
    ),
    "thin-driven-layer": Code(
        "driven layers of `ulsph` particles at a surface, fewer than the kernel needs",
        "a region as deep as the support, three spacings with the default kernel",
    ),
    "thin-pressure-region": Code(
        "a peridynamic pressure in a region that cuts off more than a tenth of its forces",
        "a region with a depth of at least two horizons",
    ),
}

NOTES = {
    "beyond-the-end": Code("times of results after the end of the run", "times up to `end_time`"),
    "bodies": Code("the interaction of each pair of bodies", "`[[contact]]`, `[[tie]]` or `[[bond]]` for another one"),
    "boundary-without-effect": Code("a boundary that the method of a body does not have", "give it a `body`"),
    "chosen-weights": Code("weights that the method chose", "state `method.weights` for others"),
    "collision-course": Code("bodies that will meet without a contact", "`[[contact]]`"),
    "few-layers": Code("a slender body with few particles across, and its stiffness", "a smaller spacing"),
    "linear-motion": Code("what `parsolid modes` neglects because the motion is small", "nothing, if intended"),
    "loaded-faces": Code("loaded faces with kernel weights, which carry loads unevenly", '`method.weights = "best"`'),
    "mesh-quality": Code("shape and size of elements, and those that determine the step", "better elements there"),
    "part-size": Code("the size of a part from a mesh", "`shape.mesh.scale` for another size"),
    "lost-waves": Code("a law that loses ellipticity at strains of 0.3", "another law for strains that large"),
    "mesh-scale": Code("a mesh so large for its waves that it may be in millimetres", "`shape.mesh.scale = 1e-3`"),
    "other-method": Code("results of another method, of which only some fields are taken", "name the fields"),
    "restart-change": Code("a key that differs from that of the checkpoint", "nothing, if intended"),
    "restart-energy": Code("energy that allowed changes have added to the state of a restart", "nothing, if intended"),
    "load-step-cost": Code("unknowns of equilibria, and the cost of a load step", "nothing"),
    "results-moved": Code("results of an earlier run that were moved away", "another `-o`, if not intended"),
    "turned-elements": Code("inverted elements of a mesh, which are turned", "nothing, or another export"),
    "unused-nodes": Code("nodes of a mesh without elements, which are ignored", "nothing, or elements there"),
    "second-order-elements": Code("elements of second order, of which only the corners are used", "nothing"),
    "sheared-part": Code("a part sheared between held regions, its softness", "`method.stabilisation.coefficient = 1`"),
    "stabilisation-in-contact": Code(
        "the stabilisation of peridynamic bodies in contact", "state `method.stabilisation.coefficient` for another one"
    ),
    "stiff-volumes": Code("stiff volumes: many iterations", "a body from a mesh, or a smaller Poisson's ratio"),
    "transfer-in-contact": Code("the transfer of `mpm` bodies in contact", "state `method.transfer` for another one"),
    "uneven-particles": Code("uneven particles with kernel weights", '`method.weights = "closure"` or `"mesh"`'),
    "uneven-traction": Code("uneven particles under a traction", '`method.traction = "consistent-everywhere"`'),
    "unstable-transfer": Code("a transfer that is unstable with its basis", '`transfer = "flip"`, or a spline basis'),
}

ENERGY_CHECK = {
    "energy-unaccounted": Code(
        "unbalanced: the energy error exceeds `method.balance_warning` of the largest energy",
        "shorter steps (`cfl`, `safety`, `solution.step`); a finer lattice if contact is stiff",
    ),
    "energy-given": Code(
        "unbalanced: the scheme, or a dissipation that falls, added more than `method.balance_warning` of the largest "
        "energy",
        "shorter steps; a finer lattice if bonds break",
    ),
    "long-step": Code("unbalanced: kinetic energy swings within a step", "shorter steps (`safety`, `solution.step`)"),
    "momentum-lost": Code("unbalanced: momentum changes without external forces", "another method or option"),
    "angular-momentum-lost": Code("unbalanced: angular momentum changes without forces", '`mpm`: `transfer = "apic"`'),
    "beyond-the-method": Code(
        "inapplicable: the state is outside of the range of the method, such as rotations in small strain",
        "another method, or finite strain",
    ),
    "scaled-inertia": Code(
        "inapplicable: with `method.mass_scaling` kinetic energy exceeds 5 % of the internal energy",
        "a smaller `mass_scaling`, or loads that grow more slowly and smoothly",
    ),
    "numerical-dissipation": Code(
        "dissipative: the scheme dissipated more than `method.dissipation_warning` of the energy input",
        "a finer lattice, weights that close, less `dissipation`",
    ),
    "artificial-viscosity": Code(
        "dissipative: scheme and artificial viscosity together dissipated more", "a smaller `viscosity`, or finer"
    ),
}


def page() -> str:
    """All codes as a page of the manual (Markdown)."""
    groups = {"Errors in a scene": FAULTS, "Warnings": WARNINGS, "Notes": NOTES, "Energy check": ENERGY_CHECK}
    lines = ["# Codes of errors, warnings and notes", ""]
    for title, codes in groups.items():
        lines += [f"## {title}", "", "| code | meaning | what to do |", "|---|---|---|"]
        lines += [f"| `{code}` | {one.says} | {one.remedy} |" for code, one in codes.items()] + [""]
    return "\n".join(lines)


# codes that `--silence` accepts
CODES = WARNINGS | NOTES


class Warned(NamedTuple):
    """A warning; inapplicable: the method cannot represent the scene."""

    code: str
    text: str
    inapplicable: bool = False

    def __str__(self) -> str:
        return f"warning: {self.text} [{self.code}]"


class Note(NamedTuple):
    """A note with its code."""

    code: str
    text: str

    def __str__(self) -> str:
        return f"note: {self.text} [{self.code}]"
