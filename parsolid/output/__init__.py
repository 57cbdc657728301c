"""What a run leaves behind: checkpoints, field series, history, progress, summary."""

from parsolid.output.errors import OutputError

__all__ = ["OutputError"]
