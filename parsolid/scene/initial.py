"""Initial fields of particles from the bodies' formulas."""

import numpy as np

from parsolid.scene.schema import Scene


def initial_velocity(scene: Scene, body: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Initial velocity (n, d) [m/s] of particles with body index (n,) and reference position (n, d) [m]."""
    return _vectors(scene, body, position, "velocity")


def initial_displacement(scene: Scene, body: np.ndarray, position: np.ndarray) -> np.ndarray | None:
    """Initial displacement (n, d) [m]; None when no body has one."""
    if all(one.displacement is None for one in scene.bodies):
        return None
    return _vectors(scene, body, position, "displacement")


def initial_deformation_gradient(
    scene: Scene, body: np.ndarray, position: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Initial deformation gradient (n, d, d) and where it is given (n,) bool, the identity elsewhere; None
    without any.
    """
    if all(one.deformation_gradient is None for one in scene.bodies):
        return None
    dimension = position.shape[1]
    result = np.tile(np.eye(dimension), (len(position), 1, 1))
    given = np.zeros(len(position), bool)
    for i, one in enumerate(scene.bodies):
        here = np.flatnonzero(body == i)
        if one.deformation_gradient is not None:
            given[here] = True
            for row, formulas in enumerate(one.deformation_gradient):
                result[here, row] = formulas.evaluate(position[here])
    return result, given


def initial_temperature(scene: Scene, body: np.ndarray, position: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """Initial temperature (n,) [K]; `usual` (bodies,) [K] is taken where a body states none."""
    result = np.asarray(usual, float)[body]
    for i, one in enumerate(scene.bodies):
        if one.temperature is not None:
            here = np.flatnonzero(body == i)
            result[here] = one.temperature.evaluate(position[here])
    return result


def initial_micro_rate(scene: Scene, body: np.ndarray, position: np.ndarray) -> np.ndarray | None:
    """Initial micro-velocity v^p (n,) [1/s], 0 in bodies that state none; None when no body has one."""
    if all(one.micro_rate is None for one in scene.bodies):
        return None
    result = np.zeros(len(position))
    for i, one in enumerate(scene.bodies):
        if one.micro_rate is not None:
            here = np.flatnonzero(body == i)
            result[here] = one.micro_rate.evaluate(position[here])
    return result


def initial_zero_energy_temperature(
    scene: Scene, body: np.ndarray, temperature: np.ndarray, reference: float
) -> np.ndarray:
    """Temperature (n,) [K] at which particles of body index (n,) and initial temperature (n,) have no internal energy.

    It is the initial one, at which a body is free of stress, but the law's reference in bodies that were heated at
    constant volume: heat that they took up on the way is a pressure then.
    """
    held = np.array([one.heated == "at-constant-volume" for one in scene.bodies])[body]
    return np.where(held, reference, temperature)


def _vectors(scene: Scene, body: np.ndarray, position: np.ndarray, key: str) -> np.ndarray:
    result = np.zeros_like(position)
    for i, one in enumerate(scene.bodies):
        formulas = getattr(one, key)
        if formulas is not None:
            here = np.flatnonzero(body == i)
            result[here] = formulas.evaluate(position[here])
    return result
