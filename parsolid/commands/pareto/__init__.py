"""`parsolid study SCENE --pareto COLUMN`: which choice of method and settings has the least error for its time."""

from parsolid.commands.pareto.command import run_pareto

__all__ = ["run_pareto"]
