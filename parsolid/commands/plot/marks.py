"""What says how large bodies are and which way they are seen: axes and a bar of a round length."""

from typing import Any

import numpy as np

from parsolid.commands.plot.scales import prefixed

# pixels from the bottom of a picture, and its width
HEIGHT, _ARROW, _BAR = 84, 26.0, 84.0
_INK = "#303030"


def add_marks(figure: Any, left: float, size: tuple[int, int], directions: np.ndarray, pixels: float) -> None:
    """Draw into the lower right corner, from a place `left` [pixels] on.

    size: of the picture [pixels]; directions (d, 2): of the coordinates' axes in the picture; pixels: a metre's length.
    """
    axes = figure.add_axes((left / size[0], 0.0, 1.0 - left / size[0], HEIGHT / size[1]))
    width = size[0] - left
    axes.set(xlim=(0.0, width), ylim=(0.0, HEIGHT))
    axes.set_axis_off()
    middle = np.array([0.4 * width, 0.56 * HEIGHT])
    for name, direction in zip("xyz", directions):
        tip = middle + _ARROW * direction
        if np.hypot(*direction) < 0.15:
            continue  # along the line of sight
        arrow = {"arrowstyle": "-|>", "color": _INK, "linewidth": 1.1, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", tip, middle, arrowprops=arrow)
        place = tip + 7.0 * direction / np.hypot(*direction)
        axes.text(*place, name, ha="center", va="center", fontsize=9, color=_INK)
    # the largest of 1, 2 and 5 times a power of ten below a length [m]
    most = min(_BAR, width - 8.0) / pixels
    power = 10.0 ** np.floor(np.log10(most))
    length = float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most * (1.0 + 1e-9)))
    first = 0.5 * (width - length * pixels)
    axes.plot([first, first + length * pixels], [17.0, 17.0], color=_INK, linewidth=2.0, solid_capstyle="butt")
    unit, label = prefixed("m", length)
    axes.text(0.5 * width, 13.0, f"{length / unit:g} {label}", ha="center", va="top", fontsize=9, color=_INK)
