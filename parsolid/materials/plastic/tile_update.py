"""One step of elastic-plastic solids on a tile of 32 particles, for every method that advances a deviator by rates.

    sigma = s - P 1,   P = A(J) + gamma E,   s along the elastic trial s + 2 mu e, returned to the flow stress

A method makes a tile (`parsolid.tiles`) by `new_tile`, and for every 32 particles

    load_state(...), and loads DEVIATOR and what else they carry; `fill_idle` gives the rest of a tile a state at rest
    start_step(law, law.failure, tile)         pressure, melting temperature, shear modulus, heat capacity, wave speed
    adds to HEAT what else heats, which may depend on these (viscous pressure)
    flow(law, law.failure, step, tile)         return to the flow stress, plastic work
    finish_step(law, law.failure, step, tile)  energy, temperature, pressure; failure; wave speed
    store_state(...)

Rows that the method fills; those with * are replaced by their values at the end of the step:

    DEVIATOR*        6: s [Pa], components as in `parsolid.tensors`, in the axes of the strain (turned by the method)
    STRAIN           6: deviatoric strain increment e of the step
    PLASTIC_STRAIN*  equivalent plastic strain ep;   ENERGY* E [J/m^3] per reference volume;   TEMPERATURE* [K]
    JACOBIAN, MIDDLE_JACOBIAN, NEW_JACOBIAN: rho0/rho at the start, for work in the step, and at the end
    HEAT             what heats besides plastic work, conduction included [J/m^3] of reference volume, in the step
    DAMAGE*, STRENGTH (factor, 1 without scatter), CRITERIA* .. (a row each): of laws that fail

and what the update adds, of the end of the step unless said otherwise:

    PRESSURE [Pa], SHEAR_MODULUS [Pa], MELTING [K] and CAPACITY rho0 C_v [J/(m^3 K)] of its start, SPEED of pressure
    waves [m/s] (after `start_step`: at the start), INCREMENT of ep, PLASTIC_WORK and RELEASED (elastic energy that
    failure turns into heat) [J/m^3] of reference volume, ROOM: positive where the state is sound

Failed matter (DAMAGE 1) has no deviator, and a pressure only where it is compressed: in tension a void opens at no
pressure, and its volume has to close before pressure comes back. The internal energy is continuous at failure: what
was stored elastically is heat from then on.

Laws with kinematic hardening flow about a back stress beta, along s - beta, whose size is returned to the flow stress.
BACK_STRESS* (6, as the deviator) is theirs, and the update adds PLASTIC_FLOW, the plastic strain of the step, and
BACK_STRESS_ENERGY, the part of PLASTIC_WORK that the back stress has stored; the rest of it is dissipated, and heats.

Laws whose flow changes the volume have PLASTIC_VOLUME*, its logarithmic strain, and COMPACTION*, that of the cap alone;
P is that of the elastic part of J, and VOLUME_WORK is the part of PLASTIC_WORK that pressure does.

A method that carries deformation gradients has rows DEFORMATION*, VELOCITY_GRADIENT, ROTATION and VOLUME_RATE for them.
The rows METRIC*, STRESS*, LOGARITHMS, FAR, WAVES and REFERENTIAL_BACK_STRESS* are those of `total_lagrangian`.
"""

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.materials.failure.failure import Criteria, Loading
from parsolid.materials.failure.functions import damage_after
from parsolid.materials.law_functions import law_function
from parsolid.materials.plastic.functions import (
    SLOWEST_RATE,
    back_stress_energy,
    back_stress_step,
    cold_pressure,
    elastic_jacobian,
    flow_stress,
    grueneisen_coefficient,
    isentropic_bulk_modulus,
    melting_temperature,
    room_to_compress,
    shear_modulus,
    specific_heat,
    temperature_rise,
    wave_speed,
)
from parsolid.materials.plastic.linear_hardening import LinearHardening
from parsolid.tensors import (
    add_spherical,
    combine_symmetric,
    congruence,
    contract_symmetric,
    plus_symmetric,
    symmetric_part,
    times_symmetric,
)
from parsolid.tiles import TILE, load_rows, load_symmetric, store_rows, store_symmetric

DEVIATOR, STRAIN = 0, 6
PLASTIC_STRAIN, ENERGY, TEMPERATURE = 12, 13, 14
JACOBIAN, MIDDLE_JACOBIAN, NEW_JACOBIAN = 15, 16, 17
HEAT, DAMAGE, STRENGTH = 18, 19, 20
PRESSURE, MELTING, SHEAR_MODULUS, CAPACITY, SPEED = 21, 22, 23, 24, 25
INCREMENT, PLASTIC_WORK, RELEASED, ROOM = 26, 27, 28, 29
DEFORMATION, VELOCITY_GRADIENT, ROTATION, VOLUME_RATE = 30, 39, 48, 57
# scratch of the return: trial von Mises stress, bracket, last point, slope, whether it still moves; work of the stress
TRIAL, _LOW, _HIGH, _OLD, _OLD_RESIDUAL, _SLOPE, MOVES, _WORK, WORST = 58, 59, 60, 61, 62, 63, 64, 65, 66
# six rows of the return, free for laws that return in their own way
SCRATCH = _LOW
METRIC, STRESS, LOGARITHMS, WAVES = 67, 73, 82, 85
BACK_STRESS, PLASTIC_FLOW, REFERENTIAL_BACK_STRESS = 91, 97, 103
BACK_STRESS_ENERGY, BACK_WORK = 109, 110
# scratch of flow about a back stress: s:s, s:beta, beta:beta of the trial deviator
_SQUARE, _PRODUCT, _BACK_SQUARE = 111, 112, 113
PLASTIC_VOLUME, COMPACTION, VOLUME_WORK = 114, 115, 116
FAR, CRITERIA = 117, 118
# of the return: the residual over the trial stress
_TOLERANCE, _MOST_STEPS = 1e-10, 80


def new_tile(criteria: int = 0) -> np.ndarray:
    """A tile, of a law with a number of criteria of failure, at rest."""
    tile = np.zeros((CRITERIA + criteria) * TILE)
    rows = tile.reshape(-1, TILE)
    rows[[JACOBIAN, MIDDLE_JACOBIAN, NEW_JACOBIAN, STRENGTH, TEMPERATURE]] = 1.0
    for first in (DEFORMATION, ROTATION):
        rows[[first, first + 4, first + 8]] = 1.0
    rows[METRIC : METRIC + 3] = 1.0
    return tile


@inlined
def load_state(numbers, failing, strength, first, count, tile):
    """What particles first .. first + count - 1 carry besides stress or strain, fields (components, particles).

    numbers: fields of PLASTIC_STRAIN, ENERGY and TEMPERATURE; failing: damage and damage by each criterion, None where
    the law never fails; strength: its factors, or None.
    """
    load_rows(numbers[0], first, count, tile, PLASTIC_STRAIN)
    load_rows(numbers[1], first, count, tile, ENERGY)
    load_rows(numbers[2], first, count, tile, TEMPERATURE)
    if failing is not None:
        load_rows(failing[0], first, count, tile, DAMAGE)
        load_rows(failing[1], first, count, tile, CRITERIA)
    if strength is not None:
        load_rows(strength, first, count, tile, STRENGTH)


@inlined
def store_state(numbers, failing, first, count, tile):
    """The way back of `load_state`."""
    store_rows(numbers[0], first, count, tile, PLASTIC_STRAIN)
    store_rows(numbers[1], first, count, tile, ENERGY)
    store_rows(numbers[2], first, count, tile, TEMPERATURE)
    if failing is not None:
        store_rows(failing[0], first, count, tile, DAMAGE)
        store_rows(failing[1], first, count, tile, CRITERIA)


@kernel
def fill_idle(law, tile, count):
    """Give all particles of a tile but the first `count` the state of one at rest."""
    for p in range(count, TILE):
        for row in range(CRITERIA):
            tile[row * TILE + p] = 0.0
        tile[TEMPERATURE * TILE + p] = law.reference_temperature
        for row in (JACOBIAN, MIDDLE_JACOBIAN, NEW_JACOBIAN, STRENGTH):
            tile[row * TILE + p] = 1.0
        for c in (0, 4, 8):
            tile[(DEFORMATION + c) * TILE + p] = 1.0
        for c in range(3):
            tile[(METRIC + c) * TILE + p] = 1.0


@inlined
def deviatoric_strain(turn, velocity_gradient, step):
    """STRAIN of a deviator in Jaumann's rate: dev D dt of a step [s], the first half of it turned by the rotation of
    the step (`tensors.spin_rotation`), of second order."""
    D = symmetric_part(velocity_gradient)
    half = times_symmetric(0.5 * step, add_spherical(D, -(D[0] + D[1] + D[2]) / 3.0))
    return plus_symmetric(congruence(turn, half), half)


@kernel
def start_step(law, failure, tile):
    """PRESSURE, MELTING, SHEAR_MODULUS, CAPACITY and SPEED of the start of the step."""
    eos, gamma = law.equation_of_state, grueneisen_coefficient(law.equation_of_state)
    for p in range(TILE):
        J, temperature = tile[JACOBIAN * TILE + p], tile[TEMPERATURE * TILE + p]
        elastic = elastic_jacobian(law.flow_stress, J, tile[PLASTIC_VOLUME * TILE + p])
        pressure = cold_pressure(eos, elastic) + gamma * tile[ENERGY * TILE + p]
        if failure is not None:
            pressure = pressure if tile[DAMAGE * TILE + p] < 1.0 else max(pressure, 0.0)
        melting = melting_temperature(law.melting, J)
        mu = shear_modulus(law.shear_modulus, J, pressure, temperature, melting)
        tile[PRESSURE * TILE + p], tile[MELTING * TILE + p], tile[SHEAR_MODULUS * TILE + p] = pressure, melting, mu
        tile[CAPACITY * TILE + p] = law.density * specific_heat(law, temperature)
        tile[SPEED * TILE + p] = wave_speed(law, J, pressure, mu)


@inlined
def load_if_any(field, first, count, tile, row):
    """Rows of particles first .. first + count - 1 that not all laws have; field: None where the law has none."""
    if field is not None:
        load_rows(field, first, count, tile, row)


@inlined
def store_if_any(field, first, count, tile, row):
    """The way back of `load_if_any`."""
    if field is not None:
        store_rows(field, first, count, tile, row)


@kernel
def flow(law, failure, step, tile):
    """Return the deviator to the flow stress after a step [s]: DEVIATOR, PLASTIC_STRAIN, INCREMENT, PLASTIC_WORK."""
    _flow(law, failure, law.kinematic_hardening, step, tile)


@kernel
def _flow(law, failure, hardening, step, tile):
    for p in range(TILE):
        s, strain = load_symmetric(tile, DEVIATOR * TILE + p), load_symmetric(tile, STRAIN * TILE + p)
        twice = 2.0 * tile[SHEAR_MODULUS * TILE + p]
        trial = (s[0] + twice * strain[0], s[1] + twice * strain[1], s[2] + twice * strain[2],
                 s[3] + twice * strain[3], s[4] + twice * strain[4], s[5] + twice * strain[5])  # fmt: skip
        tile[TRIAL * TILE + p] = (1.5 * contract_symmetric(trial, trial)) ** 0.5
        tile[INCREMENT * TILE + p], tile[VOLUME_WORK * TILE + p] = 0.0, 0.0
    if hardening is not None:
        find_relative_trial(1.0, tile)
    if step > 0.0:
        # without time to flow in, a stress above that of slow flow stays
        plastic_increments(law.flow_stress, law, hardening, step, tile)
    if hardening is not None:
        move_back_stress(hardening, 1.0, tile)
    for p in range(TILE):
        s, strain = load_symmetric(tile, DEVIATOR * TILE + p), load_symmetric(tile, STRAIN * TILE + p)
        mu, trial, increment = tile[SHEAR_MODULUS * TILE + p], tile[TRIAL * TILE + p], tile[INCREMENT * TILE + p]
        returned = trial - 3.0 * mu * increment
        factor = returned / trial if increment > 0.0 else 1.0
        work = tile[NEW_JACOBIAN * TILE + p] * returned * increment + tile[VOLUME_WORK * TILE + p]
        if hardening is not None:
            work += tile[BACK_WORK * TILE + p]
        if failure is not None:
            whole = tile[DAMAGE * TILE + p] < 1.0
            factor, increment, work = (
                (factor if whole else 0.0),
                (increment if whole else 0.0),
                (work if whole else 0.0),
            )
        twice = 2.0 * mu
        new = (factor * (s[0] + twice * strain[0]), factor * (s[1] + twice * strain[1]),
               factor * (s[2] + twice * strain[2]), factor * (s[3] + twice * strain[3]),
               factor * (s[4] + twice * strain[4]), factor * (s[5] + twice * strain[5]))  # fmt: skip
        if hardening is not None:
            left = 1.0 if tile[DAMAGE * TILE + p] < 1.0 else 0.0
            trial_stress = combine_symmetric(1.0, s, twice, strain)
            flowed = load_symmetric(tile, PLASTIC_FLOW * TILE + p)
            new = times_symmetric(left, combine_symmetric(1.0, trial_stress, -twice, flowed))
        both = contract_symmetric(s, strain) + contract_symmetric(new, strain)
        tile[_WORK * TILE + p] = 0.5 * tile[MIDDLE_JACOBIAN * TILE + p] * both
        store_symmetric(tile, DEVIATOR * TILE + p, new)
        tile[INCREMENT * TILE + p], tile[PLASTIC_WORK * TILE + p] = increment, work
        tile[PLASTIC_STRAIN * TILE + p] += increment


@kernel
def find_relative_trial(share, tile):
    """TRIAL of the deviator less the back stress, and what `relative_stress` needs. share: of the strain of the step
    that DEVIATOR lacks in the trial state."""
    for p in range(TILE):
        trial, back = _trial_deviator(share, tile, p), load_symmetric(tile, BACK_STRESS * TILE + p)
        relative = combine_symmetric(1.0, trial, -1.0, back)
        tile[TRIAL * TILE + p] = (1.5 * contract_symmetric(relative, relative)) ** 0.5
        tile[_SQUARE * TILE + p] = contract_symmetric(trial, trial)
        tile[_PRODUCT * TILE + p] = contract_symmetric(trial, back)
        tile[_BACK_SQUARE * TILE + p] = contract_symmetric(back, back)


@inlined
def _trial_deviator(share, tile, p):
    s, strain = load_symmetric(tile, DEVIATOR * TILE + p), load_symmetric(tile, STRAIN * TILE + p)
    return combine_symmetric(1.0, s, 2.0 * share * tile[SHEAR_MODULUS * TILE + p], strain)


@inlined
def relative_stress(hardening, tile, p, x):
    """What the flow stress [Pa] would be if x were the INCREMENT of particle p: with hardening
    |s - kept beta| - (3 mu + kept modulus) x, in von Mises stresses of the trial deviator s (Eterovic & Bathe, Int. J.
    Numer. Methods Eng. 30 (1990) 1099; see `functions.back_stress_step`)."""
    mu = tile[SHEAR_MODULUS * TILE + p]
    if hardening is not None:
        kept, modulus = back_stress_step(hardening, x)
        square = tile[_SQUARE * TILE + p] + kept * (
            kept * tile[_BACK_SQUARE * TILE + p] - 2.0 * tile[_PRODUCT * TILE + p]
        )
        result = (1.5 * max(square, 0.0)) ** 0.5 - (3.0 * mu + kept * modulus) * x
    else:
        result = tile[TRIAL * TILE + p] - 3.0 * mu * x
    return result


@kernel
def move_back_stress(hardening, share, tile):
    """BACK_STRESS after the INCREMENT, PLASTIC_FLOW, and the energies of both; TRIAL is what is returned to the flow
    stress along the flow. Failed matter does not flow."""
    for p in range(TILE):
        x, J = tile[INCREMENT * TILE + p], tile[NEW_JACOBIAN * TILE + p]
        x = x if tile[DAMAGE * TILE + p] < 1.0 else 0.0
        back = load_symmetric(tile, BACK_STRESS * TILE + p)
        kept, modulus = back_stress_step(hardening, x)
        relative = combine_symmetric(1.0, _trial_deviator(share, tile, p), -kept, back)
        size = (1.5 * contract_symmetric(relative, relative)) ** 0.5
        flowed = times_symmetric(1.5 * x / max(size, 1e-300), relative)
        new = combine_symmetric(kept, back, 2.0 / 3.0 * kept * modulus, flowed)
        tile[TRIAL * TILE + p] = size - kept * modulus * x
        # of the mean back stress
        tile[BACK_WORK * TILE + p] = 0.5 * J * (contract_symmetric(back, flowed) + contract_symmetric(new, flowed))
        before, after = contract_symmetric(back, back), contract_symmetric(new, new)
        stored = back_stress_energy(hardening, after) - back_stress_energy(hardening, before)
        tile[BACK_STRESS_ENERGY * TILE + p] = J * stored
        store_symmetric(tile, BACK_STRESS * TILE + p, new)
        store_symmetric(tile, PLASTIC_FLOW * TILE + p, flowed)


@kernel
def release_back_stress(law, hardening, tile):
    """Failed matter has no back stress: what it stored is RELEASED as heat. hardening: that of the law, or None."""
    if hardening is not None:
        for p in range(TILE):
            back, failed = load_symmetric(tile, BACK_STRESS * TILE + p), tile[DAMAGE * TILE + p] >= 1.0
            stored = tile[NEW_JACOBIAN * TILE + p] * back_stress_energy(hardening, contract_symmetric(back, back))
            lost, left = stored if failed else 0.0, 0.0 if failed else 1.0
            tile[RELEASED * TILE + p] += lost
            tile[TEMPERATURE * TILE + p] += temperature_rise(law, tile[TEMPERATURE * TILE + p], lost)
            for c in range(6):
                tile[(BACK_STRESS + c) * TILE + p] *= left
                tile[(REFERENTIAL_BACK_STRESS + c) * TILE + p] *= left


@law_function
def plastic_increments(flow, law, hardening, step, tile):
    """INCREMENT x of the equivalent plastic strain in a step [s] with

        trial - 3 mu x = sigma_y(ep + x, x/step, T + heating sigma_y x),

    heating: taylor_quinney J/(rho0 C_v) [K/(J/m^3)]; 0 where the trial state is elastic. With kinematic hardening (None
    without) the left side is `relative_stress`. Laws whose flow changes the volume advance PLASTIC_VOLUME and
    COMPACTION, too, and put VOLUME_WORK [J/m^3]."""


@law_function
def flow_stress_before(flow, plastic_strain, rate, temperature, shear_modulus, melting_temperature, returned):
    """Flow stress [Pa] at the start of a step; of one that depends on the pressure that at its end, `returned`."""


@flow_stress_before.otherwise
def _flow_stress_before(flow, plastic_strain, rate, temperature, shear_modulus, melting_temperature, returned):
    return flow_stress(flow, plastic_strain, rate, temperature, shear_modulus, melting_temperature)


@plastic_increments.of(LinearHardening)
def _linear_increments(flow, law, hardening, step, tile):
    if hardening is not None:
        _guarded_increments(flow, law, hardening, step, tile)
    else:
        _linear_in_closed_form(flow, tile)


@inlined
def _linear_in_closed_form(flow, tile):
    for p in range(TILE):
        temperature, melting = tile[TEMPERATURE * TILE + p], tile[MELTING * TILE + p]
        mu = tile[SHEAR_MODULUS * TILE + p]
        yielding = flow_stress(flow, tile[PLASTIC_STRAIN * TILE + p], SLOWEST_RATE, temperature, mu, melting)
        slope = flow.hardening if temperature < melting else 0.0
        tile[INCREMENT * TILE + p] = max((tile[TRIAL * TILE + p] - yielding) / (3.0 * mu + slope), 0.0)


@plastic_increments.otherwise
@inlined
def _guarded_increments(flow, law, hardening, step, tile):
    # Newton's method with the slope through the last two points, and bisection where it leaves the bracket
    flowing = 0
    for p in range(TILE):
        trial, mu = tile[TRIAL * TILE + p], tile[SHEAR_MODULUS * TILE + p]
        yielding = flow_stress(flow, tile[PLASTIC_STRAIN * TILE + p], SLOWEST_RATE, tile[TEMPERATURE * TILE + p], mu,
                               tile[MELTING * TILE + p])  # fmt: skip
        flows = trial > yielding
        strain = load_symmetric(tile, STRAIN * TILE + p)
        # in steady flow the whole strain of the step is plastic
        expected, high = (2.0 / 3.0 * contract_symmetric(strain, strain)) ** 0.5, trial / (3.0 * mu)
        tile[INCREMENT * TILE + p] = min(expected, 0.999 * high) if flows else 0.0
        tile[MOVES * TILE + p] = 1.0 if flows else 0.0
        tile[_LOW * TILE + p], tile[_HIGH * TILE + p], tile[_SLOPE * TILE + p] = 0.0, high, -3.0 * mu
        tile[_OLD * TILE + p], tile[_OLD_RESIDUAL * TILE + p] = 0.0, 0.0
        flowing += 1 if flows else 0
    iteration = 0
    while flowing > 0 and iteration < _MOST_STEPS:
        halves = iteration > 12 and iteration % 2 == 0
        flowing = 0
        for p in range(TILE):
            x, trial, mu = tile[INCREMENT * TILE + p], tile[TRIAL * TILE + p], tile[SHEAR_MODULUS * TILE + p]
            returned = relative_stress(hardening, tile, p, x)
            heating = law.taylor_quinney * tile[NEW_JACOBIAN * TILE + p] / tile[CAPACITY * TILE + p]
            residual = returned - flow_stress(
                flow, tile[PLASTIC_STRAIN * TILE + p] + x, max(x / step, SLOWEST_RATE),
                tile[TEMPERATURE * TILE + p] + heating * returned * x, mu, tile[MELTING * TILE + p])  # fmt: skip
            moves = tile[MOVES * TILE + p] > 0.0 and abs(residual) > _TOLERANCE * trial
            low = x if residual > 0.0 else tile[_LOW * TILE + p]
            high = tile[_HIGH * TILE + p] if residual > 0.0 else x
            # not through x = 0, where a flow stress in ln(rate) is steep; rounding can spoil it between close points
            secant = (residual - tile[_OLD_RESIDUAL * TILE + p]) / (x - tile[_OLD * TILE + p])
            slope = secant if iteration > 0 and secant < 0.0 else tile[_SLOPE * TILE + p]
            new = x - residual / slope
            inside = new > low and new < high and not halves
            new = new if inside else 0.5 * (low + high)
            tile[_LOW * TILE + p], tile[_HIGH * TILE + p], tile[_SLOPE * TILE + p] = low, high, slope
            tile[_OLD * TILE + p], tile[_OLD_RESIDUAL * TILE + p] = x, residual
            tile[INCREMENT * TILE + p] = new if moves else x
            tile[MOVES * TILE + p] = 1.0 if moves else 0.0
            flowing += 1 if moves else 0
        iteration += 1


@kernel
def finish_step(law, failure, step, tile):
    """ENERGY, TEMPERATURE, PRESSURE and SPEED of the end of a step [s], and failure in it: DAMAGE, RELEASED.

    Closed form of E+ = E + W + heat - (P + P+)/2 (J+ - J) with P+ = A(J+) + gamma E+; T dS and -gamma T tr d likewise.
    """
    eos, gamma = law.equation_of_state, grueneisen_coefficient(law.equation_of_state)
    for p in range(TILE):
        new_J, pressure = tile[NEW_JACOBIAN * TILE + p], tile[PRESSURE * TILE + p]
        change, heat = new_J - tile[JACOBIAN * TILE + p], tile[HEAT * TILE + p]
        elastic = elastic_jacobian(law.flow_stress, new_J, tile[PLASTIC_VOLUME * TILE + p])
        cold, part = cold_pressure(eos, elastic), 0.5 * gamma * change
        worked = tile[ENERGY * TILE + p] + tile[_WORK * TILE + p] + heat
        dissipated = tile[PLASTIC_WORK * TILE + p] - tile[BACK_STRESS_ENERGY * TILE + p]
        warmed = law.taylor_quinney * dissipated + heat
        temperature = tile[TEMPERATURE * TILE + p]
        rise = temperature_rise(law, temperature, warmed)
        energy = (worked - 0.5 * (pressure + cold) * change) / (1.0 + part)
        new_temperature, new_pressure = (temperature * (1.0 - part) + rise) / (1.0 + part), cold + gamma * energy
        if failure is not None:
            # a void is open at no pressure where none arises at the energy that it then has: the closed form has no
            # solution where a large void closes by more than 2/gamma in a step
            without = worked - 0.5 * pressure * change
            opened = tile[DAMAGE * TILE + p] >= 1.0 and cold + gamma * without <= 0.0
            energy = without if opened else energy
            new_temperature = temperature + rise if opened else new_temperature
            new_pressure = 0.0 if opened else new_pressure
        tile[ENERGY * TILE + p], tile[TEMPERATURE * TILE + p] = energy, new_temperature
        tile[PRESSURE * TILE + p], tile[RELEASED * TILE + p] = new_pressure, 0.0
    if failure is not None:
        _fail(law, failure, step, tile)
        release_back_stress(law, law.kinematic_hardening, tile)
    for p in range(TILE):
        J = tile[NEW_JACOBIAN * TILE + p]
        room = room_to_compress(eos, J)
        if failure is not None:
            # failed matter with voids is no faster than undeformed matter
            J = J if tile[DAMAGE * TILE + p] < 1.0 else min(J, 1.0)
        speed = wave_speed(law, J, tile[PRESSURE * TILE + p], tile[SHEAR_MODULUS * TILE + p])
        tile[SPEED * TILE + p] = speed
        # the speed where the room is none, or not a number
        tile[ROOM * TILE + p] = room if room < speed else speed


@law_function
def advance_damage(criteria, row, step, tile):
    """Advance the damage of each criterion of a chain, in rows from `row` on; raises WORST to the largest."""


@advance_damage.of(None)
def _no_other_criterion(criteria, row, step, tile):
    return None


@advance_damage.of(Criteria)
def _one_more_criterion(criteria, row, step, tile):
    _advance_criterion(criteria.first, row, step, tile)
    advance_damage(criteria.others, row + 1, step, tile)


@kernel
def _advance_criterion(criterion, row, step, tile):
    """Advance the damage of one criterion, in a row of its own."""
    for p in range(TILE):
        increment = tile[INCREMENT * TILE + p]
        loading = Loading(
            load_symmetric(tile, DEVIATOR * TILE + p),
            tile[PRESSURE * TILE + p],
            tile[PLASTIC_STRAIN * TILE + p],
            increment,
            increment / max(step, 1e-300),
            tile[TEMPERATURE * TILE + p],
            tile[MELTING * TILE + p],
        )
        damage = damage_after(criterion, tile[row * TILE + p], tile[STRENGTH * TILE + p], loading)
        tile[row * TILE + p] = damage
        tile[WORST * TILE + p] = max(tile[WORST * TILE + p], damage)


@kernel
def _fail(law, failure, step, tile):
    """DAMAGE after a step [s]; where it reaches 1 the deviator and tension go, and what they stored is heat."""
    for p in range(TILE):
        tile[WORST * TILE + p] = tile[DAMAGE * TILE + p]
    advance_damage(failure.criteria, CRITERIA, step, tile)
    for p in range(TILE):
        old = tile[DAMAGE * TILE + p]
        damage = min(tile[WORST * TILE + p], 1.0) if old < 1.0 else old
        failed, fails = damage >= 1.0, damage >= 1.0 and old < 1.0
        s, strain, J = (
            load_symmetric(tile, DEVIATOR * TILE + p),
            load_symmetric(tile, STRAIN * TILE + p),
            tile[NEW_JACOBIAN * TILE + p],
        )
        pressure, mu = tile[PRESSURE * TILE + p], tile[SHEAR_MODULUS * TILE + p]
        tension, change = min(pressure, 0.0), J - tile[JACOBIAN * TILE + p]
        # the forces of the next step do not know the stress that is lost, so its half of this step's work was not done
        unpaid = 0.5 * (J - 0.5 * change) * contract_symmetric(s, strain) - 0.5 * tension * change
        # beyond the spinodal the bulk modulus says nothing
        bulk = max(isentropic_bulk_modulus(law.equation_of_state, J, pressure), mu)
        stored = J * contract_symmetric(s, s) / (4.0 * mu) + J * tension * tension / (2.0 * bulk)
        released = max(stored - unpaid, 0.0) if fails else 0.0
        tile[RELEASED * TILE + p], tile[DAMAGE * TILE + p] = released, damage
        tile[ENERGY * TILE + p] -= unpaid if fails else 0.0
        tile[TEMPERATURE * TILE + p] += temperature_rise(law, tile[TEMPERATURE * TILE + p], released)
        left = 0.0 if failed else 1.0
        store_symmetric(tile, DEVIATOR * TILE + p, times_symmetric(left, s))
        tile[PRESSURE * TILE + p] = max(pressure, 0.0) if failed else pressure
