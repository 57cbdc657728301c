"""What is shown of material points besides their fields."""

import numpy as np

from parsolid.materials.plastic.plastic_evaluation import melting_temperature


def shown(points, name: str, first: int, last: int) -> np.ndarray | None:
    """See `protocol.ParticleSystem.shown`; points: `MaterialPoints`."""
    here = slice(first, last)
    if name == "deformation_gradient":
        return points.deformation_gradients(first, last)
    if name == "velocity_gradient":
        return points["velocity_gradient"][here].reshape(-1, 3, 4)[:, :, :3].copy()
    volumes = points.motion[here, 7] * points.jacobian(first, last) if name in ("density", "stress") else None
    if name == "density":
        return points["mass"][here] / volumes
    if name == "stress":
        xx, yy, zz, _, yz, xz, xy, _ = points["stress_and_volume"][here].T
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1) / volumes[:, None, None]
    return None


def can_melt(points) -> bool:
    """Whether a law has a melting temperature; the same on all ranks."""
    return any(getattr(law, "melting", None) is not None for law in points.laws)


def homologous_temperatures(points) -> np.ndarray:
    """T / T_m of this rank's particles that can melt."""
    parts = [np.zeros(0)]
    for block in points.warm_blocks:
        if block.law.melting is not None:
            temperature = points["temperature"][block.first : block.last]
            parts.append(temperature / melting_temperature(block.law, points.jacobian(block.first, block.last)))
    return np.concatenate(parts)


def first_unsound(points, listed: np.ndarray) -> tuple[int, str] | None:
    """See `protocol.ParticleSystem.unsound`; listed: rows of the particles that are in a cell."""
    rows, jacobian = points.owned_rows, points.jacobian(0, points.owned)
    numbers = (rows("velocity"), rows("position"), rows("stress_and_volume"), jacobian[:, None])
    finite = np.all([np.isfinite(values).all(axis=1) for values in numbers], axis=0)
    lost = np.ones(points.owned, bool)
    lost[listed] = False
    for bad, what in (
        (~finite, "a number is no longer finite"),
        (~(jacobian > 0.0), "the Jacobian is not positive: matter is turned inside out"),
        (lost, "it has left the grid"),
    ):
        if bad.any():
            return int(np.argmax(bad)), what
    return None
