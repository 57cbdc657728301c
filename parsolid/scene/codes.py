"""Every code of a fault, a warning, a note and of the energy check: what it says, and what to do; warnings and notes.

Codes never change; the manual's page of codes is made from these tables.
"""

from typing import NamedTuple


class Code(NamedTuple):
    """What a code says, and what to do."""

    says: str
    remedy: str


FAULTS = {
    "unknown-key": Code("a key that the table does not have", "the suggested one, or one of `parsolid keys TABLE`"),
    "missing": Code("a key that is needed, or one of several of which one is", "state it"),
    "exclusive": Code("keys of which at most, or exactly, one may stand", "leave the others out"),
    "type": Code("a value of another type", "state what is expected: a number, a text, a list, a table, true or false"),
    "bound": Code("a number outside of its bounds, or not finite", "state one within them"),
    "length": Code("a list that is too long or too short", "as many entries as are expected, often one per dimension"),
    "choice": Code("a word that is none of those known", "the suggested one, or another of the list"),
    "formula": Code("a formula that cannot be read", "use X, Y, Z, t and the functions of docs/parts.md"),
    "file": Code("a file that is not there or cannot be read", "paths are relative to the folder of the scene"),
    "method": Code("what the method of the scene or body does not know", "another kind, or another method"),
    "unknown-name": Code("a body, region, field or column that is not there", "the suggested one, or declare it"),
    "repeated": Code("a name or an entry that stands twice", "rename or remove one"),
    "contradiction": Code(
        "conditions that hold a component of the same particles to different values",
        "take the particles out of one of the regions, or leave the component 'free' there",
    ),
    "touching": Code(
        "bodies that touch and that no table names, or a bond of bodies that do not touch",
        "`[[contact]]`, `[[tie]]` or `[[bond]]`, see docs/contact.md",
    ),
    "elsewhere": Code("a plane or a point at no body", "check coordinates and units (SI)"),
    "geometry": Code(
        "a file of geometry that Gmsh cannot mesh", "install `parsolid[cad]`, state `size`, or mend the file"
    ),
    "element": Code("elements of a mesh inside out or flat", "mend the mesh there"),
    "double-node": Code("nodes of a mesh at one place, which nothing joins", "merge them, or make two bodies"),
    "hanging-node": Code(
        "nodes of a mesh in the middle of facets or edges, where elements come apart", "split the elements there"
    ),
    "edge-contact": Code(
        "parts of a mesh that share an edge alone, or in the plane a node", "join or separate them there"
    ),
    "self-overlap": Code("elements of a mesh in one another", "mend the mesh there"),
    "open-surface": Code("a surface of triangles with edges of one triangle", "close it, or mesh its volume"),
    "refused": Code("what the other keys of the scene exclude, in words", "as the message says what is expected"),
}

WARNINGS = {
    "badly-held": Code(
        "a plane at rest by `velocity` in `mpm`: on linear weights, or neither on nodes nor half-way between",
        "`roller` or `fixed` on nodes or half-way between (`method.origin`)",
    ),
    "cell-below-spacing": Code(
        "cells of `mpm` smaller than the spacing: points move apart freely", "cells of two spacings (`method.cell`)"
    ),
    "friction-of-rattling-bodies": Code(
        "friction between bodies that nothing damps: it may lag behind what moves them",
        "let loads grow slowly, or give one body a method or a material that damps",
    ),
    "undeclared-contact": Code(
        'bodies that have met though no contact names them (`undeclared_contact = "warn"`)', "`[[contact]]`"
    ),
    "one-layer": Code("one layer of particles across a body that is free there", "two layers or more, or plane strain"),
    "too-stiff": Code(
        "bodies with a Poisson's ratio above .45 without pressures as unknowns: meshes in motion, boxes in equilibrium",
        "a body from a mesh in equilibria and long steps (`method.integrator`); finer ones in motion",
    ),
    "wrong-bending": Code(
        "slender bodies in `mpm` that the transfer `flip` bends wrongly, stiffer most often",
        '`transfer = "apic"`; or four points across and two a cell and direction',
    ),
    "thin-driven-layer": Code(
        "layers of `ulsph` particles at a surface that are driven, and fewer than the kernel reaches",
        "a region as deep as the support, three spacings with the usual kernel",
    ),
    "thin-pressure-region": Code(
        "a peridynamic pressure in a region that cuts off more than a tenth of its forces",
        "a region of two horizons depth at least",
    ),
}

NOTES = {
    "bodies": Code("how each pair of bodies meets", "`[[contact]]`, `[[tie]]` or `[[bond]]` for another way"),
    "boundary-without-effect": Code("a boundary that the method of a body does not know", "give it a `body`"),
    "chosen-weights": Code("weights that the method chose", "state `method.weights` for others"),
    "collision-course": Code("bodies that will meet though no contact names them", "`[[contact]]`"),
    "clamp-edges": Code("mass that is told without a part of that of clamped edges", "`method.clamp_edges = 0`"),
    "few-layers": Code("a slender body with few particles across, and how stiff it is", "a smaller spacing"),
    "linear-motion": Code("what `parsolid modes` leaves out, as motion is small", "nothing, if that is meant"),
    "loaded-faces": Code("loaded faces with weights of a kernel, which bear unevenly", '`method.weights = "best"`'),
    "mesh-quality": Code(
        "shape and size of a mesh's elements, and which of them set the step", "better elements there"
    ),
    "part-size": Code("how large a part from a mesh is", "`shape.mesh.scale` where it should be another size"),
    "lost-waves": Code("a law whose waves grow at strains of 0.3", "another law, where strain is not small"),
    "mesh-scale": Code("a mesh so large for its waves that it may be in millimetres", "`shape.mesh.scale = 1e-3`"),
    "other-method": Code("results of another method, of which some fields alone are taken", "name the fields"),
    "restart-change": Code("a key that differs from that of the checkpoint", "nothing, if that is meant"),
    "restart-energy": Code("energy that allowed changes have given to the state of a restart", "nothing, if meant"),
    "load-step-cost": Code("unknowns of equilibria, and what a load step takes", "nothing"),
    "results-moved": Code("results of an earlier run that are in another folder now", "another `-o`, if not meant"),
    "turned-elements": Code(
        "elements of a mesh whose nodes are ordered inside out, which are turned", "nothing, or another export"
    ),
    "unused-nodes": Code("nodes of a mesh that no element has, which are left out", "nothing, or elements there"),
    "second-order-elements": Code("elements of second order, which are taken by their corners", "nothing"),
    "sheared-part": Code(
        "a part that is sheared between held regions, and how soft it is", "`method.stabilisation.coefficient = 1`"
    ),
    "stabilisation-in-contact": Code(
        "the control of peridynamic bodies in contact", "state `method.stabilisation.coefficient` for another"
    ),
    "stiff-volumes": Code(
        "volumes so stiff that a solution takes many iterations", "a body from a mesh, or a smaller Poisson's ratio"
    ),
    "transfer-in-contact": Code("the transfer of `mpm` bodies in contact", "state `method.transfer` for another"),
    "uneven-particles": Code("uneven particles with weights of a kernel", '`method.weights = "closure"` or `"mesh"`'),
    "uneven-traction": Code("uneven particles under a traction", '`method.traction = "consistent-everywhere"`'),
    "unstable-transfer": Code(
        "a transfer that is unstable with its basis", '`transfer = "flip"`, or a spline for the basis'
    ),
}

ENERGY_CHECK = {
    "energy-unaccounted": Code(
        "unbalanced: more than `method.balance_warning` of the largest energy is not accounted for",
        "shorter steps (`cfl`, `safety`, `solution.step`); a finer lattice where contact is stiff",
    ),
    "energy-given": Code(
        "unbalanced: more than `method.balance_warning` of the largest energy came from the scheme, or from another "
        "dissipation that fell",
        "shorter steps; a finer lattice where bonds break",
    ),
    "long-step": Code("unbalanced: kinetic energy swings within a step", "shorter steps (`safety`, `solution.step`)"),
    "momentum-lost": Code("unbalanced: nothing acts from outside, and momentum changes", "another method or option"),
    "angular-momentum-lost": Code(
        "unbalanced: nothing acts from outside, and angular momentum changes", '`mpm`: `transfer = "apic"`'
    ),
    "beyond-the-method": Code(
        "inapplicable: the state is outside of what the method holds for, such as turns under small strain",
        "another method, or finite strain",
    ),
    "scaled-inertia": Code(
        "inapplicable: with `method.mass_scaling` kinetic energy exceeds 5 % of the internal energy",
        "a smaller `mass_scaling`, or loads that grow more slowly and smoothly",
    ),
    "numerical-dissipation": Code(
        "dissipative: the scheme took more than `method.dissipation_warning` of the energy that went in",
        "a finer lattice, weights that close, less `dissipation`",
    ),
    "artificial-viscosity": Code(
        "dissipative: with its artificial viscosity the scheme took more than that", "a smaller `viscosity`, or finer"
    ),
}


def page() -> str:
    """All codes as a page of the manual (Markdown)."""
    groups = {"Errors in a scene": FAULTS, "Warnings": WARNINGS, "Notes": NOTES, "Energy check": ENERGY_CHECK}
    lines = ["# Codes of errors, warnings and notes", ""]
    for title, codes in groups.items():
        lines += [f"## {title}", "", "| code | what it says | what to do |", "|---|---|---|"]
        lines += [f"| `{code}` | {one.says} | {one.remedy} |" for code, one in codes.items()] + [""]
    return "\n".join(lines)


# every code that `--silence` takes
CODES = WARNINGS | NOTES


class Warned(NamedTuple):
    """A code and words; inapplicable: whether the method cannot represent what is asked."""

    code: str
    text: str
    inapplicable: bool = False

    def __str__(self) -> str:
        return f"warning: {self.text} [{self.code}]"


class Note(NamedTuple):
    """A code and words."""

    code: str
    text: str

    def __str__(self) -> str:
        return f"note: {self.text} [{self.code}]"
