"""What a run is asked for beside itself, on the command line or in the scene."""

from argparse import Namespace

from parsolid.scene import Scene


def bars_asked(scene: Scene, options: Namespace) -> bool:
    """Whether error bars are."""
    return bool(getattr(options, "error_bars", False)) or scene.errors is not None


def targets(scene: Scene, options: Namespace) -> list[str]:
    """How small error bars shall be."""
    return list(getattr(options, "target", [])) or (scene.run.target if scene.run else [])
