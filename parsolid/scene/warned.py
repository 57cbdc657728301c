"""What is told of a scene that runs: warnings of what is likely to be wrong, notes of what its choices bring.

Each has a code that never changes; `--silence CODE` leaves it out.
"""

from typing import NamedTuple

# every code with what it says
CODES = {
    "cell-below-spacing": "cells of `mpm` smaller than the spacing: points move apart freely",
    "friction-of-rattling-bodies": "friction between bodies that nothing damps: it may lag behind what moves them",
    "one-layer": "one layer of particles across a body that is free there",
    "thin-pressure-region": "a peridynamic pressure in a region that cuts off more than a tenth of its forces",
    "bodies": "how each pair of bodies meets: bonded, in contact, tied, apart",
    "boundary-without-effect": "a boundary that the method of a body does not know",
    "chosen-weights": "weights that the method chose, as the scene states none",
    "clamp-edges": "mass that is told without a part of that of clamped edges",
    "few-layers": "a slender body with few particles across, and how stiff it is",
    "loaded-faces": "loaded faces with weights of a kernel, which bear unevenly",
    "mesh-scale": "a mesh so large for its waves that it may be in millimetres",
    "other-method": "results of another method, of which some fields alone are taken",
    "restart-change": "a key that differs from that of the checkpoint",
    "restart-energy": "energy that allowed changes have given to the state of a restart",
    "results-moved": "results of an earlier run that are in another folder now",
    "second-order-elements": "elements of second order, which are taken by their corners",
    "sheared-part": "a part that is sheared between held regions, and how soft it is",
    "stabilisation-in-contact": "the control of peridynamic bodies in contact",
    "stiff-volumes": "volumes so stiff that a solution takes many iterations",
    "transfer-in-contact": "the transfer of `mpm` bodies in contact",
    "uneven-particles": "uneven particles with weights of a kernel",
    "uneven-traction": "uneven particles under a traction",
    "undeclared-contact": "bodies that meet, or will, though no contact names them",
    "unstable-transfer": "a transfer that is unstable with its basis",
}


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
