"""What particles of updated-Lagrangian SPH carry and a scene may name."""

from functools import partial

from parsolid.particles.declaration import Columns, Field

_kept = partial(Field, components=1, checkpointed=True, layout=Columns())
# of all laws
STATE = (
    _kept("density", unit="kg/m^3", shown=True, padding=(1.0,)),
    _kept("temperature", unit="K", shown=True, padding=(1.0,)),
    _kept("plastic_strain", unit="1"),
)
# where a law has it
MICRO_STATE = (_kept("micro_rate", unit="1/s"), _kept("micro_stress", unit="Pa"))
