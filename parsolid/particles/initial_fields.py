"""Initial fields of particles, from the formulas of bodies and of initial states, which take precedence.

Functions take the particles' body index (n,), their reference position (n, d) [m], and which named regions they are in
(n, regions), needed where initial states name regions.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from parsolid.scene.schema import Scene

Regions = np.ndarray | None


def _stated(scene: Scene, body: np.ndarray, regions: Regions, key: str) -> Iterator[tuple[np.ndarray, Any]]:
    """Rows of particles and the formula stated for them; later ones take precedence."""
    for i, one in enumerate(scene.bodies):
        if getattr(one, key, None) is not None:
            yield np.flatnonzero(body == i), getattr(one, key)
    numbers = {one.name: i for i, one in enumerate(scene.bodies)}
    for state in scene.initial:
        if state.of(key) is not None and (state.body is None or state.body in numbers):
            yield np.flatnonzero(meant(scene, state, body, regions)), state.of(key)


def meant(scene: Scene, state: Any, body: np.ndarray, regions: Regions) -> np.ndarray:
    """Which particles (n,) bool an initial state applies to."""
    result = np.ones(len(body), bool)
    if state.body is not None:
        names = [one.name for one in scene.bodies]
        result &= body == (names.index(state.body) if state.body in names else -1)
    if state.where is not None:
        assert regions is not None
        result &= regions[:, list(scene.named_regions).index(state.where)] == 1
    return result


def _is_stated(scene: Scene, key: str) -> bool:
    stated = [getattr(body, key, None) for body in scene.bodies] + [state.of(key) for state in scene.initial]
    return any(one is not None for one in stated)


def taken_from_results(scene: Scene, body: np.ndarray, regions: Regions) -> np.ndarray:
    """Which particles (n,) bool take their state from another run."""
    result = np.zeros(len(body), bool)
    for state in scene.initial:
        if state.results is not None:
            result |= meant(scene, state, body, regions)
    return result


def _filled(
    values: np.ndarray, scene: Scene, body: np.ndarray, position: np.ndarray, regions: Regions, key: str
) -> np.ndarray:
    """Values (n, ...), replaced where a formula is stated; the formulas of a tensor are stated row by row."""
    for here, stated in _stated(scene, body, regions, key):
        if hasattr(stated, "evaluate"):
            values[here] = stated.evaluate(position[here])
        else:
            for row, formulas in enumerate(stated):
                values[here, row] = formulas.evaluate(position[here])
    return values


def initial_velocity(scene: Scene, body: np.ndarray, position: np.ndarray, regions: Regions = None) -> np.ndarray:
    """Initial velocity (n, d) [m/s]."""
    return _filled(np.zeros_like(position), scene, body, position, regions, "velocity")


def initial_displacement(
    scene: Scene, body: np.ndarray, position: np.ndarray, regions: Regions = None
) -> np.ndarray | None:
    """Initial displacement (n, d) [m]; None when nothing has one."""
    if not _is_stated(scene, "displacement"):
        return None
    return _filled(np.zeros_like(position), scene, body, position, regions, "displacement")


def initial_deformation_gradient(
    scene: Scene, body: np.ndarray, position: np.ndarray, regions: Regions = None
) -> tuple[np.ndarray, np.ndarray] | None:
    """Initial deformation gradient (n, d, d), the identity where none is stated, and where one is (n,) bool; None
    without any."""
    if not _is_stated(scene, "deformation_gradient"):
        return None
    key, identity = "deformation_gradient", np.tile(np.eye(position.shape[1]), (len(position), 1, 1))
    given = np.zeros(len(position), bool)
    for here, _ in _stated(scene, body, regions, key):
        given[here] = True
    return _filled(identity, scene, body, position, regions, key), given


def states_stress(scene: Scene) -> bool:
    """Whether an initial state has a stress."""
    return any(state.of("stress") is not None for state in scene.initial)


def initial_stress(scene: Scene, body: np.ndarray, position: np.ndarray, regions: Regions = None) -> np.ndarray:
    """Initial stress (n, d, d) [Pa] without deformation, 0 where none is stated."""
    d = position.shape[1]
    return _filled(np.zeros((len(position), d, d)), scene, body, position, regions, "stress")


def initial_temperature(
    scene: Scene, body: np.ndarray, position: np.ndarray, usual: np.ndarray, regions: Regions = None
) -> np.ndarray:
    """Initial temperature (n,) [K]; `usual` (bodies,) [K] where none is stated."""
    return _filled(np.asarray(usual, float)[body], scene, body, position, regions, "temperature")


def initial_plastic_strain(scene: Scene, body: np.ndarray, position: np.ndarray, regions: Regions = None) -> np.ndarray:
    """Initial equivalent plastic strain (n,), 0 where nothing is stated."""
    return _filled(np.zeros(len(body)), scene, body, position, regions, "plastic_strain")


def initial_micro_rate(scene: Scene, body: np.ndarray, position: np.ndarray) -> np.ndarray | None:
    """Initial micro-velocity v^p (n,) [1/s], 0 in bodies that state none; None when no body has one."""
    if not _is_stated(scene, "micro_rate"):
        return None
    return _filled(np.zeros(len(body)), scene, body, position, None, "micro_rate")


def initial_zero_energy_temperature(
    scene: Scene, body: np.ndarray, temperature: np.ndarray, reference: float
) -> np.ndarray:
    """Temperature (n,) [K] at which particles of body index (n,) and initial temperature (n,) have no internal energy.

    It is the initial one, at which a body is free of stress; in bodies heated at constant volume it is the law's
    reference, so that the heat gives a pressure.
    """
    held = np.array([one.thermal_reference == "at-constant-volume" for one in scene.bodies])[body]
    return np.where(held, reference, temperature)
