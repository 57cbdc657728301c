"""Fields over one coordinate, each time in its colour."""

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from parsolid.commands.plot.scales import prefixed, time_labels
from parsolid.output.results import Results
from parsolid.output.words import labelled, unit_of, words_of

_SIZE, _DOTS_PER_INCH = (640, 420), 100


def write_lines(
    results: Results, field: str, steps: list[int], path: Path, size: tuple[int, int] | None = None, axis: int = 0
) -> None:
    """Draw a field at some steps into one figure, over the present coordinate `axis` of all particles: curves of a bar,
    points of bodies in the plane and in space, where many particles have the same coordinate.
    """
    look = {"linewidth": 1.1} if results.dimension == 1 else {"linestyle": "none", "marker": ".", "markersize": 3.0}
    frames = list(results.frames(steps, field))
    labels = time_labels([frame.time for frame in frames])
    largest = max((np.nanmax(np.abs(frame.values)) for frame in frames), default=0.0)
    unit, label = prefixed(unit_of(field), largest)
    farthest = max((np.abs(frame.position[:, axis]).max() for frame in frames), default=0.0)
    length, metres = prefixed("m", float(farthest))
    width, height = size or _SIZE
    figure = Figure(figsize=(width / _DOTS_PER_INCH, height / _DOTS_PER_INCH), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for number, (frame, text) in enumerate(zip(frames, labels)):
        place = frame.position[:, axis]
        order = np.argsort(place)
        colour = colormaps["viridis"](0.9 * number / max(1, len(frames) - 1))
        axes.plot(place[order] / length, frame.values[order] / unit, color=colour, label=text, **look)
    axes.set_xlabel(labelled("xyz"[axis], metres))
    axes.set_ylabel(labelled(words_of(field), label))
    axes.set_title(results.title, fontsize=12)
    axes.grid(alpha=0.25, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=9, frameon=False)
    figure.savefig(path, dpi=_DOTS_PER_INCH)
