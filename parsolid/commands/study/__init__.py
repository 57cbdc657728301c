"""`parsolid study STUDY.toml`: many runs, and what they say together, as error against run time and spacing."""

from parsolid.commands.study.command import add_arguments, run_study

__all__ = ["add_arguments", "run_study"]
