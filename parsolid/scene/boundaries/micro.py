"""Regions where the micro-velocity is held; everywhere else it is free."""

from typing import Literal

from parsolid.scene.boundaries.condition import boundary_kind
from parsolid.scene.boundaries.prescribed import RegionCondition


@boundary_kind
class MicroHard(RegionCondition):
    """No plastic flow: v^p = 0 in a region; surfaces without it are micro-free (no micro-traction)."""

    kind: Literal["micro-hard"]
