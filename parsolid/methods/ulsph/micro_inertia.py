"""Solids with micro-inertia in updated-Lagrangian SPH: the state between the two sweeps, and fluxes after them.

The order is that of a leapfrog (docs/microinertia.md): stresses, micro-velocity and temperature see fluxes of the start
of the step, fluxes see gradients of its end. The law's equations are in `materials.plastic.micro_inertia`.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import inlined, kernel, reduction
from parsolid.materials.plastic import micro_inertia as law_of_solid
from parsolid.materials.plastic.jaumann_rate import returned_deviator
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
    STRESS,
    TAU,
    TEMPERATURE,
    TRIAL,
    advance_micro,
    increments_of,
    new_tile,
)
from parsolid.materials.plastic.tile_update import DEVIATOR, STRAIN, TILE, load_symmetric, store_symmetric
from parsolid.methods.ulsph.kinematics import (
    CORRECTION,
    GROWTH,
    ROWS,
    find_gradients,
    load_columns,
    load_rates,
    store_columns,
    store_pair_stress,
    symmetric_times,
    turn_deviator,
)
from parsolid.particles.container import Particles
from parsolid.scene import Scene
from parsolid.tensors import combine_symmetric, contract_symmetric, times_symmetric

# rows of a tile behind DEVIATOR and STRAIN: pressure, power of the dissipative flux, grad v^p
_PRESSURE, _POWER, _GRADIENT, _ROWS = 12, 13, 14, 17


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
def vector_of(field, a):
    """A vector of three components of particle a, with 0 out of the plane."""
    return (field[0, a], field[1, a], field[2, a] if field.shape[0] == 3 else 0.0)


@inlined
def set_vector(field, a, u):
    """Set the components of a vector of particle a that a field has."""
    field[0, a], field[1, a] = u[0], u[1]
    if field.shape[0] == 3:
        field[2, a] = u[2]


@kernel
def load_micro(state, curl, gradient, dissipative, flows, first, count, kinematics, solid, tile):
    """Rows of `micro_inertia_solve` from the particles' fields, and what fluxes need; the step's mean density."""
    load_columns(state.micro_rate, 1, first, count, tile, RATE)
    load_columns(state.micro_stress, 1, first, count, tile, STRESS)
    load_columns(state.plastic_strain, 1, first, count, tile, GAMMA)
    load_columns(state.temperature, 1, first, count, tile, TEMPERATURE)
    if curl is not None:
        load_columns(curl, 1, first, count, tile, CURL)
    for p in range(count):
        a = first + p
        density = state.density[0, a] * kinematics[GROWTH * TILE + p]
        tile[DENSITY * TILE + p] = density
        if flows is not None:
            tile[FORCE * TILE + p] = density / state.mass[0, a] * flows[a, 0]
        if gradient is not None:
            g = vector_of(gradient, a)
            solid[_GRADIENT * TILE + p], solid[(_GRADIENT + 1) * TILE + p] = g[0], g[1]
            solid[(_GRADIENT + 2) * TILE + p] = g[2]
            tile[GRADIENT_SQUARE * TILE + p] = g[0] * g[0] + g[1] * g[1] + g[2] * g[2]
            if dissipative is not None:
                xi = vector_of(dissipative, a)
                solid[_POWER * TILE + p] = xi[0] * g[0] + xi[1] * g[1] + xi[2] * g[2]


@kernel
def hold_clamped(free, first, count, share, tile):
    """No flow where the micro-velocity is held; `share` of the micro-stress relaxes."""
    for p in range(count):
        if free[0, first + p] <= 0.0:
            tile[NEW_RATE * TILE + p], tile[MEAN_RATE * TILE + p] = 0.0, 0.0
            tile[NEW_TAU * TILE + p] = tile[TRIAL * TILE + p]
            tile[NEW_STRESS * TILE + p] = (1.0 - share) * tile[STRESS * TILE + p]
            tile[HEAT * TILE + p], tile[LOST * TILE + p] = 0.0, 0.0


@kernel
def advance_state(
    first, last, law, increments, most, in_plane, rates, flows, state, free, curl, gradient, dissipative, tile
):
    """State of particles first..last-1 after a step from the sums of the first sweep.

    law: of `in_numbers`; increments: of `increments_of`; most, in_plane: see `kinematics`; tile: of
    `micro_inertia_solve`. None where there is no such thing: flows; free, 0 where the micro-velocity is held; curl,
    gradient, dissipative, see `Gradients`. Returns (sound, plastic heat [J], energy [J] lost by the integration).
    """
    sound, plastic, lost, step = True, 0.0, 0.0, increments.step
    kinematics, solid = np.zeros(ROWS * TILE), np.zeros(_ROWS * TILE)
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        load_rates(rates, state.mass, state.density, in_plane, None, i, count, kinematics)
        load_columns(state.deviator, 6, i, count, solid, DEVIATOR)
        find_gradients(step, most, in_plane, kinematics)
        for p in range(TILE):
            S = load_symmetric(solid, DEVIATOR, p)
            tile[TAU * TILE + p] = contract_symmetric(S, S) ** 0.5
        turn_deviator(step, kinematics, solid)
        for p in range(TILE):
            trial = combine_symmetric(
                1.0, load_symmetric(solid, DEVIATOR, p), 2.0 * law.shear_modulus, load_symmetric(solid, STRAIN, p)
            )
            tile[TRIAL * TILE + p] = contract_symmetric(trial, trial) ** 0.5
            store_symmetric(solid, STRAIN, p, trial)
        load_micro(state, curl, gradient, dissipative, flows, i, count, kinematics, solid, tile)
        advance_micro(law, increments, tile)
        if free is not None:
            hold_clamped(free, i, count, increments.relax_stress, tile)
        for p in range(TILE):
            turned, trial = load_symmetric(solid, DEVIATOR, p), load_symmetric(solid, STRAIN, p)
            flowed = law.shear_modulus * step * tile[MEAN_RATE * TILE + p]
            new = returned_deviator(turned, trial, tile[TAU * TILE + p], tile[NEW_TAU * TILE + p], flowed)
            store_symmetric(solid, DEVIATOR, p, new)
        if curl is not None:
            for p in range(count):
                norm = max(tile[TRIAL * TILE + p], 1e-300)
                direction = times_symmetric(1.0 / norm, load_symmetric(solid, STRAIN, p))
                curl[0, i + p] += step * law_of_solid.curl_rate(vector_of(gradient, i + p), direction)
        for p in range(count):
            a, growth, middle = i + p, kinematics[GROWTH * TILE + p], tile[DENSITY * TILE + p]
            heat = tile[HEAT * TILE + p] + 0.5 * step * solid[_POWER * TILE + p]
            warming = heat
            if flows is not None:
                warming -= step * middle / state.mass[0, a] * flows[a, 1]
            state.temperature[0, a] += warming / (middle * law.specific_heat)
            state.density[0, a] *= growth * growth
            state.plastic_strain[0, a] += step * tile[MEAN_RATE * TILE + p]
            solid[_PRESSURE * TILE + p] = law_of_solid.pressure(law, state.density[0, a] / law.density)
            plastic += state.mass[0, a] / middle * heat
            lost += state.mass[0, a] / middle * tile[LOST * TILE + p]
            number = tile[NEW_TAU * TILE + p] + tile[NEW_RATE * TILE + p] + state.temperature[0, a]
            sound = sound and state.density[0, a] > 0.0 and number + 1.0 > 0.0
        store_columns(state.deviator, 6, i, count, solid, DEVIATOR)
        store_columns(state.micro_rate, 1, i, count, tile, NEW_RATE)
        store_columns(state.micro_stress, 1, i, count, tile, NEW_STRESS)
        store_columns(state.correction, 6, i, count, kinematics, CORRECTION)
        store_pair_stress(
            solid, _PRESSURE, kinematics, CORRECTION, state.density, in_plane, i, count, state.pair_stress
        )
    return sound, plastic, lost


@kernel
def advance_fluxes(
    first,
    last,
    law,
    increments,
    stride,
    slopes,
    state,
    viscous_heat,
    curl,
    gradient,
    energetic,
    dissipative,
    heat,
    pair_micro_flux,
    pair_heat_flux,
):
    """Fluxes after a step from the sums of the second sweep, and those that neighbours read.

    viscous_heat: where it warms, else None; others as in `advance_state`; pair fluxes None where they do not flow.
    Returns the dissipation of the micro-flux in the second half of the step [J].
    """
    plastic, step = 0.0, increments.step
    for a in range(first, last):
        mass, density = state.mass[0, a], state.density[0, a]
        B, inverse = tensor_of(state.correction, a), 1.0 / (mass * density)
        warming, g = 0.0, (0.0, 0.0, 0.0)
        if gradient is not None:
            g = symmetric_times(B, slope_of(slopes, a, 0, stride, inverse))
            set_vector(gradient, a, g)
        if dissipative is not None:
            xi = vector_of(dissipative, a)
            warming = 0.5 * step * (xi[0] * g[0] + xi[1] * g[1] + xi[2] * g[2])
            plastic += mass / density * warming
        if viscous_heat is not None:
            warming += step * density / mass * viscous_heat[0, a]
        state.temperature[0, a] += warming / (density * law.specific_heat)
        factor, flux = 1.0 / (density * density), (0.0, 0.0, 0.0)
        if energetic is not None:
            flux = law_of_solid.energetic_flux(law, step, vector_of(energetic, a), g)
            set_vector(energetic, a, flux)
        if dissipative is not None:
            eta = 0.0
            if curl is not None:
                eta = curl[0, a]
            rate, gamma, square = (
                state.micro_rate[0, a],
                state.plastic_strain[0, a],
                g[0] * g[0] + g[1] * g[1] + g[2] * g[2],
            )
            resisted = law_of_solid.resistance(law, rate, square, gamma, eta, state.temperature[0, a])
            xi = law_of_solid.dissipative_flux(law, increments.relax_flux, vector_of(dissipative, a), g, resisted)
            set_vector(dissipative, a, xi)
            flux = (flux[0] + xi[0], flux[1] + xi[1], flux[2] + xi[2])
        if pair_micro_flux is not None:
            set_vector(pair_micro_flux, a, symmetric_times(B, (factor * flux[0], factor * flux[1], factor * flux[2])))
        if heat is not None:
            steepness = symmetric_times(B, slope_of(slopes, a, stride, stride, inverse))
            q = law_of_solid.heat_flux(law, increments.relax_heat, vector_of(heat, a), steepness)
            set_vector(heat, a, q)
            set_vector(pair_heat_flux, a, symmetric_times(B, (factor * q[0], factor * q[1], factor * q[2])))
    return plastic


@inlined
def tensor_of(field, a):
    """A symmetric tensor of particle a."""
    return (field[0, a], field[1, a], field[2, a], field[3, a], field[4, a], field[5, a])


@inlined
def slope_of(slopes, a, column, stride, factor):
    """A sum of the second sweep times a factor, three components."""
    third = slopes[a, column + 2] if stride == 4 else 0.0
    return (factor * slopes[a, column], factor * slopes[a, column + 1], factor * third)


@reduction
def energies(first, last, law, state, energetic):
    """Kinetic energy of the micro-velocity and stored energy [J] of particles first..last-1."""
    kinetic, stored = 0.0, 0.0
    for a in range(first, last):
        density, S = state.density[0, a], tensor_of(state.deviator, a)
        volume, square = state.mass[0, a] / density, 0.0
        if energetic is not None:
            xi = vector_of(energetic, a)
            square = xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]
        elastic = law_of_solid.deviatoric_energy(law, contract_symmetric(S, S) ** 0.5)
        elastic += density * law_of_solid.volumetric_energy(law, density / law.density)
        stored += volume * (elastic + law_of_solid.gradient_energy(law, square))
        kinetic += volume * law_of_solid.micro_kinetic_energy(law, density, state.micro_rate[0, a])
    return kinetic, stored


@kernel
def least_micro_step(first, last, law, length, state, curl, gradient):
    """Least stable step [s] of micro-rate and micro-flux of particles first..last-1."""
    least = np.inf
    for a in range(first, last):
        eta = 0.0
        if curl is not None:
            eta = curl[0, a]
        g = vector_of(gradient, a)
        square = g[0] * g[0] + g[1] * g[1] + g[2] * g[2]
        rate, gamma, temperature = state.micro_rate[0, a], state.plastic_strain[0, a], state.temperature[0, a]
        step = law_of_solid.micro_time_step(
            law, length[0, a], state.density[0, a], rate, square, gamma, eta, temperature
        )
        least = min(least, step)
    return least


class MicroInertiaSolid:
    """Particles of one law with micro-inertia on a rank; see `ElasticPlasticSolid`."""

    stores_heat = speeds_change = False

    def __init__(self, law: MicroInertia):
        self.law, self._numbers, self._tile = law, in_numbers(law), new_tile()
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

    def begin(self, scene: Scene, particles: Particles, here: slice) -> None:
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
        """Fluxes from the sums of the second sweep; what of them is dissipated [J]."""
        of = system.particles.storage
        heats = system.viscosity is not None and system.settings.viscous_heating
        if not (self.flows or heats):
            return 0.0
        state, gradients = self._state(system.particles)
        told = (of(f"pair_{flow}_flux") if flow in self.flows else None for flow in ("micro", "heat"))
        sums = system.neighbours
        return float(
            advance_fluxes(
                here.start, here.stop, self._numbers, increments_of(self.law, step), sums.stride, sums.slopes, state,
                of("viscous_heat") if heats else None, *gradients, *told,
            )
        )  # fmt: skip

    def energies(self, particles: Particles, here: slice) -> tuple[float, float]:
        """Kinetic energy of the micro-velocity, and stored energy [J]."""
        state, gradients = self._state(particles)
        kinetic, stored = energies(here.start, here.stop, self._numbers, state, gradients.energetic)
        return kinetic, stored

    def stable_step(self, particles: Particles, here: slice) -> float:
        """What fluxes allow [s]."""
        state, gradients = self._state(particles)
        length = particles.storage("smoothing_length")
        step = law_of_solid.heat_time_step(self._numbers, float(length[0, here].min()))
        if gradients.energetic is not None or gradients.dissipative is not None:
            of_fluxes = gradients.curl, gradients.gradient
            step = min(step, least_micro_step(here.start, here.stop, self._numbers, length, state, *of_fluxes))
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
        """No other energies than those of `advance` and `advance_fluxes`."""
        return {}
