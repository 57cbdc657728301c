"""Solids with micro-inertia in updated-Lagrangian SPH: the state between the two sweeps, and fluxes after them.

The order is that of a leapfrog (docs/ulsph.md): stresses, micro-velocity and temperature see fluxes of the start
of the step, fluxes see gradients of its end. The law's equations are in `materials.plastic.micro_inertia`.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import inlined, kernel, reduction
from parsolid.materials.plastic import micro_inertia as law_of_solid
from parsolid.materials.plastic.micro_inertia import MicroInertia, in_numbers
from parsolid.materials.plastic.micro_inertia_solve import (
    CURL,
    DENSITY,
    FORCE,
    GAMMA,
    GRADIENT_SQUARE,
    HEAT,
    LOST,
    MEAN_RATE,
    NEW_RATE,
    NEW_STRESS,
    NEW_TAU,
    RATE,
    ROWS,
    STRESS,
    TAU,
    TEMPERATURE,
    TRIAL,
    advance_micro,
    increments_of,
    new_tile,
)
from parsolid.materials.plastic.tile_update import DEVIATOR, STRAIN
from parsolid.methods.ulsph import kinematics as flow
from parsolid.methods.ulsph.heat import symmetric_times
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene
from parsolid.tensors import combine_symmetric, contract_symmetric, times_symmetric
from parsolid.tiles import (
    TILE,
    load_rows,
    load_symmetric,
    load_vector,
    store_rows,
    store_symmetric,
    store_vector,
)

# rows of the tile behind those of `micro_inertia_solve`: numbers, B, vectors
_MASS, _PRESSURE, _POWER, _WARMTH, _STEP, _DISSIPATED = range(ROWS, ROWS + 6)
_CORRECTION = ROWS + 6
_GRADIENT, _STEEPNESS, _ENERGETIC, _DISSIPATIVE, _HEAT_FLUX, _PAIR_MICRO, _PAIR_HEAT = range(ROWS + 12, ROWS + 33, 3)
_ALL_ROWS = ROWS + 33


class State(NamedTuple):
    """Fields (components, particles) that every law of the kind has, see `state`."""

    mass: np.ndarray
    density: np.ndarray
    correction: np.ndarray
    deviator: np.ndarray
    temperature: np.ndarray
    plastic_strain: np.ndarray
    micro_rate: np.ndarray
    micro_stress: np.ndarray
    pair_stress: np.ndarray


class Gradients(NamedTuple):
    """Fields of laws with a length, each None without: curl eta^p, gradient grad v^p, xi_en, xi_dis, heat flux q."""

    curl: Any
    gradient: Any
    energetic: Any
    dissipative: Any
    heat: Any


@inlined
def load_vectors(field, first, count, tile, row):
    """A field of vectors into three rows, with 0 out of the plane."""
    load_rows(field, first, count, tile, row)
    if field.shape[0] == 2:
        tile[(row + 2) * TILE : (row + 3) * TILE] = 0.0


@inlined
def load_slopes(slopes, column, stride, first, count, tile, row):
    """A sum of the second sweep into three rows, with 0 out of the plane; stride as in `sweeps`."""
    for p in range(count):
        tile[row * TILE + p], tile[(row + 1) * TILE + p] = slopes[first + p, column], slopes[first + p, column + 1]
        tile[(row + 2) * TILE + p] = slopes[first + p, column + 2] if stride == 4 else 0.0


@inlined
def load_flow(state, curl, gradient, first, count, tile):
    """Rows of `micro_inertia_solve` that the resistance to flow depends on, and grad v^p."""
    load_rows(state.density, first, count, tile, DENSITY)
    load_rows(state.micro_rate, first, count, tile, RATE)
    load_rows(state.plastic_strain, first, count, tile, GAMMA)
    load_rows(state.temperature, first, count, tile, TEMPERATURE)
    if curl is not None:
        load_rows(curl, first, count, tile, CURL)
    if gradient is not None:
        load_vectors(gradient, first, count, tile, _GRADIENT)
        for p in range(TILE):
            tile[GRADIENT_SQUARE * TILE + p] = square_of(load_vector(tile, _GRADIENT * TILE + p))


@inlined
def square_of(u):
    """u . u of three components."""
    return u[0] * u[0] + u[1] * u[1] + u[2] * u[2]


@inlined
def resistance_of(law, tile, p):
    """S_g R_1 R_2/d^p [Pa s] of a particle of a tile."""
    return law_of_solid.resistance(
        law, tile[RATE * TILE + p], tile[GRADIENT_SQUARE * TILE + p], tile[GAMMA * TILE + p],
        tile[CURL * TILE + p], tile[TEMPERATURE * TILE + p])  # fmt: skip


@inlined
def hold_clamped(free, first, count, share, tile):
    """No flow where the micro-velocity is held; `share` of the micro-stress relaxes."""
    for p in range(count):
        if free[0, first + p] <= 0.0:
            tile[NEW_RATE * TILE + p], tile[MEAN_RATE * TILE + p] = 0.0, 0.0
            tile[NEW_TAU * TILE + p] = tile[TRIAL * TILE + p]
            tile[NEW_STRESS * TILE + p] = (1.0 - share) * tile[STRESS * TILE + p]
            tile[HEAT * TILE + p], tile[LOST * TILE + p] = 0.0, 0.0


@kernel
def find_trial(step, shear_modulus, rates, tile):
    """TAU of the start of a step [s], the turned deviator, and the trial deviator, into STRAIN, with its norm TRIAL."""
    for p in range(TILE):
        S = load_symmetric(tile, DEVIATOR * TILE + p)
        tile[TAU * TILE + p] = contract_symmetric(S, S) ** 0.5
    flow.turn_deviator(step, rates, None, tile)
    for p in range(TILE):
        turned, strain = load_symmetric(tile, DEVIATOR * TILE + p), load_symmetric(tile, STRAIN * TILE + p)
        trial = combine_symmetric(1.0, turned, 2.0 * shear_modulus, strain)
        tile[TRIAL * TILE + p] = contract_symmetric(trial, trial) ** 0.5
        store_symmetric(tile, STRAIN * TILE + p, trial)


@kernel
def end_step(law, step, curl, rates, tile):
    """State of the end of a step [s], after `advance_micro`: deviator, curl, temperature, gamma, density, pressure;
    plastic heat and energy lost [J] in _DISSIPATED and LOST.

    curl: not None where the law has a length of hardening. _WARMTH: conducted heat [J/m^3] of the step."""
    for p in range(TILE):
        turned, trial = load_symmetric(tile, DEVIATOR * TILE + p), load_symmetric(tile, STRAIN * TILE + p)
        flowed = law.shear_modulus * step * tile[MEAN_RATE * TILE + p]
        new = law_of_solid.returned_deviator(turned, trial, tile[TAU * TILE + p], tile[NEW_TAU * TILE + p], flowed)
        store_symmetric(tile, DEVIATOR * TILE + p, new)
    for p in range(TILE):
        if curl is not None:
            norm = max(tile[TRIAL * TILE + p], 1e-300)
            direction = times_symmetric(1.0 / norm, load_symmetric(tile, STRAIN * TILE + p))
            rate = law_of_solid.curl_rate(load_vector(tile, _GRADIENT * TILE + p), direction)
            tile[CURL * TILE + p] += step * rate
        middle = tile[DENSITY * TILE + p]
        heat, volume = tile[HEAT * TILE + p] + 0.5 * step * tile[_POWER * TILE + p], tile[_MASS * TILE + p] / middle
        tile[TEMPERATURE * TILE + p] += (heat + tile[_WARMTH * TILE + p]) / (middle * law.specific_heat)
        tile[GAMMA * TILE + p] += step * tile[MEAN_RATE * TILE + p]
        density = middle * rates[flow.GROWTH * TILE + p]
        tile[DENSITY * TILE + p] = density
        tile[_PRESSURE * TILE + p] = law_of_solid.pressure(law, density / law.density)
        tile[_DISSIPATED * TILE + p] = volume * heat
        tile[LOST * TILE + p] *= volume


@kernel
def advance_state(
    first, last, law, increments, most, in_plane, sums, flows, state, free, curl, gradient, dissipative, tile
):
    """State of particles first..last-1 after a step from the sums of the first sweep.

    law: of `in_numbers`; increments: of `increments_of`; most, in_plane: see `kinematics`; tile: of `new_tile` with
    _ALL_ROWS. None where there is no such thing: flows; free, 0 where the micro-velocity is held; curl, gradient,
    dissipative, see `Gradients`. Returns (sound, plastic heat [J], energy [J] lost by the integration).
    """
    sound, plastic, lost, step = True, 0.0, 0.0, increments.step
    rates = np.zeros(flow.ROWS * TILE)
    tile[_WARMTH * TILE : (_WARMTH + 1) * TILE] = 0.0
    tile[_POWER * TILE : (_POWER + 1) * TILE] = 0.0
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        flow.load_rates(sums, state.mass, state.density, in_plane, None, i, count, rates)
        load_rows(state.deviator, i, count, tile, DEVIATOR)
        load_rows(state.mass, i, count, tile, _MASS)
        load_rows(state.micro_stress, i, count, tile, STRESS)
        load_flow(state, curl, gradient, i, count, tile)
        flow.find_gradients(step, most, in_plane, rates)
        find_trial(step, law.shear_modulus, rates, tile)
        for p in range(TILE):
            tile[DENSITY * TILE + p] *= rates[flow.GROWTH * TILE + p]
        if flows is not None:
            for p in range(count):
                of_mass = tile[DENSITY * TILE + p] / tile[_MASS * TILE + p]
                tile[FORCE * TILE + p] = of_mass * flows[i + p, 0]
                tile[_WARMTH * TILE + p] = -step * of_mass * flows[i + p, 1]
        if dissipative is not None:
            load_vectors(dissipative, i, count, tile, _DISSIPATIVE)
            for p in range(TILE):
                g, xi = load_vector(tile, _GRADIENT * TILE + p), load_vector(tile, _DISSIPATIVE * TILE + p)
                tile[_POWER * TILE + p] = xi[0] * g[0] + xi[1] * g[1] + xi[2] * g[2]
        advance_micro(law, increments, tile)
        if free is not None:
            hold_clamped(free, i, count, increments.relax_stress, tile)
        end_step(law, step, None if curl is None else True, rates, tile)
        for p in range(count):
            plastic += tile[_DISSIPATED * TILE + p]
            lost += tile[LOST * TILE + p]
            number = tile[NEW_TAU * TILE + p] + tile[NEW_RATE * TILE + p] + tile[TEMPERATURE * TILE + p]
            sound = sound and tile[DENSITY * TILE + p] > 0.0 and number + 1.0 > 0.0
        store_rows(state.deviator, i, count, tile, DEVIATOR)
        store_rows(state.density, i, count, tile, DENSITY)
        store_rows(state.temperature, i, count, tile, TEMPERATURE)
        store_rows(state.plastic_strain, i, count, tile, GAMMA)
        store_rows(state.micro_rate, i, count, tile, NEW_RATE)
        store_rows(state.micro_stress, i, count, tile, NEW_STRESS)
        store_rows(state.correction, i, count, rates, flow.CORRECTION)
        if curl is not None:
            store_rows(curl, i, count, tile, CURL)
        flow.store_pair_stress(
            tile, _PRESSURE, rates, flow.CORRECTION, state.density, in_plane, i, count, state.pair_stress
        )
    return sound, plastic, lost


@kernel
def find_fluxes(law, increments, warms, energetic, dissipative, heat, tile):
    """Gradients and fluxes of the end of a step from its sums of the second sweep, in _GRADIENT and _STEEPNESS.

    warms: not None where the artificial viscosity does, with its heat [W] in _WARMTH; energetic, dissipative, heat: not
    None where there are such fluxes."""
    step = increments.step
    for p in range(TILE):
        mass, density = tile[_MASS * TILE + p], tile[DENSITY * TILE + p]
        B, inverse = load_symmetric(tile, _CORRECTION * TILE + p), 1.0 / (mass * density)
        slope = load_vector(tile, _GRADIENT * TILE + p)
        g = symmetric_times(B, (inverse * slope[0], inverse * slope[1], inverse * slope[2]))
        store_vector(tile, _GRADIENT * TILE + p, g)
        tile[GRADIENT_SQUARE * TILE + p] = square_of(g)
        warming = 0.0 * density
        if dissipative is not None:
            xi = load_vector(tile, _DISSIPATIVE * TILE + p)
            warming = 0.5 * step * (xi[0] * g[0] + xi[1] * g[1] + xi[2] * g[2])
            tile[_DISSIPATED * TILE + p] = mass / density * warming
        if warms is not None:
            warming += step * density / mass * tile[_WARMTH * TILE + p]
        tile[TEMPERATURE * TILE + p] += warming / (density * law.specific_heat)
    for p in range(TILE):
        B, density = load_symmetric(tile, _CORRECTION * TILE + p), tile[DENSITY * TILE + p]
        factor, flux, g = 1.0 / (density * density), (0.0, 0.0, 0.0), load_vector(tile, _GRADIENT * TILE + p)
        if energetic is not None:
            flux = law_of_solid.energetic_flux(law, step, load_vector(tile, _ENERGETIC * TILE + p), g)
            store_vector(tile, _ENERGETIC * TILE + p, flux)
        if dissipative is not None:
            old, resisted = load_vector(tile, _DISSIPATIVE * TILE + p), resistance_of(law, tile, p)
            xi = law_of_solid.dissipative_flux(law, increments.relax_flux, old, g, resisted)
            store_vector(tile, _DISSIPATIVE * TILE + p, xi)
            flux = (flux[0] + xi[0], flux[1] + xi[1], flux[2] + xi[2])
        pair_flux = symmetric_times(B, (factor * flux[0], factor * flux[1], factor * flux[2]))
        store_vector(tile, _PAIR_MICRO * TILE + p, pair_flux)
        if heat is not None:
            inverse, slope = 1.0 / (tile[_MASS * TILE + p] * density), load_vector(tile, _STEEPNESS * TILE + p)
            steepness = symmetric_times(B, (inverse * slope[0], inverse * slope[1], inverse * slope[2]))
            old = load_vector(tile, _HEAT_FLUX * TILE + p)
            q = law_of_solid.heat_flux(law, increments.relax_heat, old, steepness)
            store_vector(tile, _HEAT_FLUX * TILE + p, q)
            pair_flux = symmetric_times(B, (factor * q[0], factor * q[1], factor * q[2]))
            store_vector(tile, _PAIR_HEAT * TILE + p, pair_flux)


@kernel
def advance_fluxes(
    first, last, law, increments, stride, slopes, state, viscous_heat, curl, gradient, energetic, dissipative, heat,
    pair_micro_flux, pair_heat_flux, tile,
):  # fmt: skip
    """Fluxes after a step from the sums of the second sweep, and those that neighbours read.

    viscous_heat: where it warms, else None; others as in `advance_state`; pair fluxes None where they do not flow.
    Returns the dissipation of the micro-flux in the second half of the step [J].
    """
    plastic = 0.0
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        load_flow(state, curl, None, i, count, tile)
        load_rows(state.mass, i, count, tile, _MASS)
        load_rows(state.correction, i, count, tile, _CORRECTION)
        load_slopes(slopes, 0, stride, i, count, tile, _GRADIENT)
        if energetic is not None:
            load_vectors(energetic, i, count, tile, _ENERGETIC)
        if dissipative is not None:
            load_vectors(dissipative, i, count, tile, _DISSIPATIVE)
        if heat is not None:
            load_vectors(heat, i, count, tile, _HEAT_FLUX)
            load_slopes(slopes, stride, stride, i, count, tile, _STEEPNESS)
        if viscous_heat is not None:
            load_rows(viscous_heat, i, count, tile, _WARMTH)
        warms, flows = None if viscous_heat is None else True, None if heat is None else True
        stores, resists = None if energetic is None else True, None if dissipative is None else True
        find_fluxes(law, increments, warms, stores, resists, flows, tile)
        store_rows(state.temperature, i, count, tile, TEMPERATURE)
        if gradient is not None:
            store_rows(gradient, i, count, tile, _GRADIENT)
            store_rows(pair_micro_flux, i, count, tile, _PAIR_MICRO)
        if energetic is not None:
            store_rows(energetic, i, count, tile, _ENERGETIC)
        if dissipative is not None:
            store_rows(dissipative, i, count, tile, _DISSIPATIVE)
            for p in range(count):
                plastic += tile[_DISSIPATED * TILE + p]
        if heat is not None:
            store_rows(heat, i, count, tile, _HEAT_FLUX)
            store_rows(pair_heat_flux, i, count, tile, _PAIR_HEAT)
    return plastic


@reduction
def energies(first, last, law, state, energetic):
    """Kinetic energy of the micro-velocity and stored energy [J] of particles first..last-1."""
    kinetic, stored = 0.0, 0.0
    for a in range(first, last):
        density, S = state.density[0, a], state.deviator[:, a]
        tau_square = S[0] * S[0] + S[1] * S[1] + S[2] * S[2] + 2.0 * (S[3] * S[3] + S[4] * S[4] + S[5] * S[5])
        volume, square = state.mass[0, a] / density, 0.0
        if energetic is not None:
            for c in range(energetic.shape[0]):
                square += energetic[c, a] * energetic[c, a]
        elastic = law_of_solid.deviatoric_energy(law, tau_square**0.5)
        elastic += density * law_of_solid.volumetric_energy(law, density / law.density)
        stored += volume * (elastic + law_of_solid.gradient_energy(law, square))
        kinetic += volume * law_of_solid.micro_kinetic_energy(law, density, state.micro_rate[0, a])
    return kinetic, stored


@kernel
def least_micro_step(first, last, law, length, state, curl, gradient, tile):
    """Least stable step [s] of micro-rate and micro-flux of particles first..last-1."""
    least = np.inf
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        load_flow(state, curl, gradient, i, count, tile)
        load_rows(length, i, count, tile, _STEP)
        for p in range(TILE):
            tile[_STEP * TILE + p] = law_of_solid.micro_time_step(
                law, tile[_STEP * TILE + p], tile[DENSITY * TILE + p], resistance_of(law, tile, p)
            )
        for p in range(count):
            least = min(least, tile[_STEP * TILE + p])
    return least


class MicroInertiaSolid:
    """Particles of one law with micro-inertia on a rank; see `ElasticPlasticSolid`."""

    stores_heat = speeds_change = False

    def __init__(self, law: MicroInertia):
        self.law, self._numbers, self._tile = law, in_numbers(law), new_tile(_ALL_ROWS)
        lengths = {
            "micro_curl": law.hardening_length,
            "energetic_flux": law.energetic_length,
            "dissipative_flux": law.dissipative_length,
        }
        fields = {name for name, length in lengths.items() if length is not None}
        flows = {"micro"} if fields else set()
        if fields:
            fields.add("micro_gradient")
        if law.conductivity is not None:
            fields.add("heat_flux")
            flows.add("heat")
        self.flows, self.fields = frozenset(flows), frozenset(fields | {"micro_rate", "micro_stress"})

    def _state(self, particles: Particles) -> tuple[State, Gradients]:
        """The fields of the law; None in place of those that it does not have though others do."""
        names = ("micro_curl", "micro_gradient", "energetic_flux", "dissipative_flux", "heat_flux")
        gradients = (particles.storage(name) if name in self.fields else None for name in names)
        return State(*(particles.storage(name) for name in State._fields)), Gradients(*gradients)

    def begin(self, scene: Scene, particles: Particles, here: slice, particle_set: ParticleSet) -> None:
        """The state at time 0; its temperatures are set."""
        particles.owned_rows("micro_stress")[here] = self.law.initial_micro_stress

    def advance(self, system: Any, here: slice, step: float) -> tuple[bool, float, float]:
        """The state after a step [s] from the sums of the first sweep: whether it is sound, plastic heat and numerical
        loss [J]."""
        state, gradients = self._state(system.particles)
        free = system.particles.storage("micro_free") if "micro_free" in system.particles else None
        sums = system.neighbours
        how = self._numbers, increments_of(self.law, step), system.most_correction, system.in_plane
        sound, heat, lost = advance_state(
            here.start, here.stop, *how, sums.rates, sums.flows if self.flows else None, state, free, gradients.curl,
            gradients.gradient, gradients.dissipative, self._tile,
        )  # fmt: skip
        return sound, heat, lost

    def advance_fluxes(self, system: Any, here: slice, step: float) -> float:
        """Fluxes from the sums of the second sweep; the energy that they dissipate [J]."""
        of = system.particles.storage
        heats = system.viscosity is not None and system.settings.viscous_heating
        if not (self.flows or heats):
            return 0.0
        state, gradients = self._state(system.particles)
        pair_fluxes = (of(f"pair_{flow}_flux") if flow in self.flows else None for flow in ("micro", "heat"))
        sums = system.neighbours
        return float(
            advance_fluxes(
                here.start, here.stop, self._numbers, increments_of(self.law, step), sums.stride, sums.slopes, state,
                of("viscous_heat") if heats else None, *gradients, *pair_fluxes, self._tile,
            )
        )  # fmt: skip

    def energies(self, particles: Particles, here: slice) -> tuple[float, float]:
        """Kinetic energy of the micro-velocity, and stored energy [J]."""
        state, gradients = self._state(particles)
        kinetic, stored = energies(here.start, here.stop, self._numbers, state, gradients.energetic)
        return kinetic, stored

    def stable_step(self, particles: Particles, here: slice) -> float:
        """Largest stable step of the fluxes [s]."""
        state, gradients = self._state(particles)
        length = particles.storage("smoothing_length")
        step = law_of_solid.heat_time_step(self._numbers, float(length[0, here].min()))
        if gradients.energetic is not None or gradients.dissipative is not None:
            of_fluxes = self._numbers, length, state, gradients.curl, gradients.gradient, self._tile
            step = min(step, least_micro_step(here.start, here.stop, *of_fluxes))
        return float(step)

    def pressures(self, particles: Particles, here: slice) -> np.ndarray:
        """p (n,) [Pa]."""
        ratio = particles.owned_rows("density")[here] / self.law.density
        return np.asarray(law_of_solid.pressure(self._numbers, ratio))

    def room(self, particles: Particles, here: slice) -> None:
        """The law holds at every density."""

    @property
    def sound_speed(self) -> float:
        """c_L [m/s] of the undeformed solid."""
        law = self.law
        return float(np.sqrt((law.bulk_modulus + 4.0 / 3.0 * law.shear_modulus) / law.density))

    def take_energies(self) -> dict[str, float]:
        """Empty: all energies are those of `advance` and `advance_fluxes`."""
        return {}
