"""Prefixes of units, colour maps and ranges of pictures."""

from dataclasses import dataclass

import numpy as np

from parsolid.output.words import labelled, unit_of, words_of

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
_PREFIXED = ("Pa", "m", "m/s", "J", "s", "W", "N", "N m")
_POWERS = {-3: "10⁻³", -6: "10⁻⁶", -9: "10⁻⁹"}
_SIGNED, _UNSIGNED = "RdBu_r", "viridis"
# field -> colour map, and whether it starts at 0 (True), is centred at 0 (False), or neither (None); other fields have
# default maps by their signs
_COLOURS: dict[str, tuple[str, bool | None]] = {
    "pressure": ("RdBu_r", False),
    "stress": ("PuOr_r", False),
    "first_piola_kirchhoff_stress": ("PuOr_r", False),
    "nodal_stress": ("PuOr_r", False),
    "von_mises_stress": ("cividis", True),
    "nodal_von_mises_stress": ("cividis", True),
    "damage": ("YlOrRd", True),
    "failure": ("YlOrRd", True),
    "plastic_strain": ("viridis", True),
    "plastic_strain_rate": ("viridis", True),
    "temperature": ("inferno", None),
    "maximum_temperature": ("inferno", None),
    "jacobian": ("BrBG", None),
}
_WHOLE = {"damage": 1.0}


@dataclass(frozen=True)
class Scale:
    """The colour scale of a field: limits in SI units, label with unit, the labelled unit in SI units."""

    lower: float
    upper: float
    label: str
    factor: float
    colours: str
    extend: str


def prefixed(unit: str, largest: float) -> tuple[float, str]:
    """(prefixed unit in SI units, its name) in which the largest value is 1 or more."""
    if unit not in _PREFIXED or not np.isfinite(largest) or largest <= 0.0:
        return 1.0, unit
    # values down to 0.02 m stay in metres
    floor = 0.02 if unit in ("m", "m/s") else 0.9995
    if unit == "Pa" and largest < floor:
        # such small values are of scenes without units: powers of ten instead of prefixes
        power = 3 * int(np.floor(np.log10(largest / floor) / 3.0)) if largest < 0.1 else 0
        return 10.0**power, f"{_POWERS.get(power, f'1e{power}')} {unit}" if power else unit
    factor, letter = next((pair for pair in _PREFIXES if largest >= floor * pair[0]), _PREFIXES[-1])
    if unit in ("m", "m/s") and factor > 1.0:
        factor, letter = 1.0, ""
    return factor, letter + unit


def scale_of(
    name: str, pieces: list[np.ndarray], limits: tuple[float, float] | None, colours: str | None = None
) -> Scale:
    """The scale of a field from its values at all times of a picture, or from given limits [SI units].

    Without limits 1 % of the values at either end may lie outside, so that a few particles do not determine the scale.
    A field has the same map in all pictures; a field without an entry in _COLOURS and with both signs gets a symmetric
    range and diverging colours.
    """
    values = np.concatenate([piece[np.isfinite(piece)] for piece in pieces] or [np.zeros(1)])
    values = values if len(values) else np.zeros(1)
    least, most = float(values.min()), float(values.max())
    lower, upper = limits or map(float, np.percentile(values, (1.0, 99.0)))
    signed = lower < 0.0 < upper and min(-lower, upper) > 0.1 * max(-lower, upper)
    # components have the map of their field
    field, _, part = name.rpartition("_")
    whole = name if name in _COLOURS or not set(part) <= set("xyz") else field
    chosen, from_zero = _COLOURS.get(whole, (None, None))
    if limits is None:
        if signed or from_zero is False:
            upper = max(-lower, upper)
            lower = -upper
        elif from_zero and lower >= 0.0:
            lower, upper = 0.0, _WHOLE.get(name, upper)
        if upper - lower <= 1e-9 * max(abs(lower), abs(upper)):
            width = 0.5 * max(abs(lower) * 1e-3, 1e-12)
            lower, upper = lower - width, upper + width
    tolerance = 1e-3 * (upper - lower)
    beyond = (least < lower - tolerance, most > upper + tolerance)
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[beyond]
    factor, unit = prefixed(unit_of(name), max(abs(lower), abs(upper)))
    label = labelled(words_of(name), unit)
    return Scale(lower, upper, label, factor, colours or chosen or (_SIGNED if signed else _UNSIGNED), extend)


def time_labels(times: list[float]) -> list[str]:
    """Labels "t = 85 ms" in one unit for all times."""
    factor, unit = prefixed("s", max(times, default=0.0))
    return [f"t = {time / factor:.4g} {unit}" for time in times]
