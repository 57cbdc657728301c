"""Contact on the nodes of the background grid: fields of velocity that may neither pass through each other nor stick.

Where both fields have mass, their velocities after the forces of a step lose what would close more than the gap between
their particles, in an inelastic blow of the node's two masses, and of the tangential part what Coulomb's law allows
(Bardenhagen, Guilkey, Roessig, Brackbill, Witzel, Foster, CMES 2 (2001) 509). Fields part freely.
"""

from typing import Any

from parsolid.methods.interaction import Interaction
from parsolid.methods.mpm.meeting import Meeting
from parsolid.methods.protocol import EnergyLedger
from parsolid.scene.contact import GRID_TERMS


class GridContact(Interaction):
    """All grid contacts of a scene: what particles give to nodes is found before the systems advance."""

    terms = GRID_TERMS

    def __init__(self, comm: Any, meetings: list[tuple[tuple[Any, Any], float]]) -> None:
        """meetings: two systems and the friction between them, each."""
        self.meetings = [Meeting(comm, systems, friction) for systems, friction in meetings]
        self.systems = list({id(one): one for systems, _ in meetings for one in systems}.values())
        self.warms = any(friction and any(one.takes_heat for one in systems) for systems, friction in meetings)

    def start_step(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Velocities of the nodes after the step's forces and contact."""
        if step == 0.0:
            return
        for system in self.systems:
            system.nodes.follow_cells()
            system.given = system.give_to_nodes(time, step)
        warmed = [meeting.act(step) for meeting in self.meetings]
        if self.warms:
            ledger.add_term("friction_heat", sum(warmed))

    def evaluate(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """What contact has taken."""
        if step == 0.0:
            return
        for meeting in self.meetings:
            pressed, rubbed = meeting.losses()
            # systems do not know what kept their particles from gaining what their forces did
            ledger.add(1.0, 0.0, -pressed - rubbed, 0.0)
            ledger.add_term("contact_dissipation", pressed)
            ledger.add_term("friction_dissipation", rubbed)
