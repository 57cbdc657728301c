"""Runs of choices from coarse to fine, of which the worse half is dropped at each level, within a budget."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

from parsolid.collective import SolverError
from parsolid.commands.pareto.choices import Choice
from parsolid.commands.pareto.measure import Truth, judge, observed_truth, stated_truth, time_to
from parsolid.commands.pareto.plan import Candidate, Plan, add
from parsolid.errors.running import Done, result_of, run_into
from parsolid.scene import SceneError
from parsolid.simulation.loop import Limits

RUNS = "runs"
# most changes that are tried together
MOST_TOGETHER = 4


@dataclass
class Search:
    """What the runs of a plan share. budget: of processor seconds; spent: of all runs that are there."""

    comm: MPI.Intracomm
    plan: Plan
    folder: Path
    budget: float
    say: Callable[[str], None]
    spent: float = 0.0
    truth: Truth | None = None

    def follow(self) -> None:
        """Make all runs. Raises Interrupted; collective."""
        plan = self.plan
        for level in range(len(plan.levels)):
            if level == 2:
                self.combine()
            alive = [one for one in plan.candidates if one.dropped is None]
            for number, one in enumerate(alive, 1):
                self.advance(one, level, f"level {level + 1} of {len(plan.levels)}, {number} of {len(alive)}")
            self.look()
            if level >= 1 and level + 1 < len(plan.levels):
                self.halve(level)

    def advance(self, one: Candidate, level: int, where: str) -> None:
        """Run a choice at a level and those below it that it lacks, unless the budget says no. Collective."""
        for number in range(len(one.runs), level + 1):
            expected = self.expected(one, number)
            if self.comm.bcast(self.spent + expected > self.budget):
                one.dropped = f"the budget: about {expected:.3g} s more were needed"
                return
            done = self.made(one.choice, number)
            if done is None or done.fault:
                one.dropped = f"failed: {done.fault if done else 'it cannot be set up'}"
                self.say(f"pareto: {where}: {one.choice.name}: {one.dropped}")
                return
            one.runs.append(done)
            self.spent += done.processor_seconds
            told = f"{done.companion.lattices}, {done.processor_seconds:.3g} s"
            self.say(f"pareto: {where}: {one.choice.name}: {told}, {self.spent:.3g} s in all")

    def expected(self, one: Candidate, level: int) -> float:
        """Processor seconds that a choice should take at a level: by its own last run, or the scene's."""
        known = one if one.runs else self.plan.candidates[0]
        if not known.runs:
            return 0.0
        last = min(level, len(known.runs) - 1)
        return known.times[last] * self.plan.work(level) / self.plan.work(last)

    def made(self, choice: Choice, level: int) -> Done | None:
        """A run, made unless it is there; None when it cannot be set up. Collective."""
        try:
            one = self.plan.run(choice, level)
            place = self.folder / RUNS / self.comm.bcast(one.digest if self.comm.rank == 0 else None)
            done = result_of(self.comm, one, place)
            if done is None:
                run_into(self.comm, one.scene, place, Limits())
                done = result_of(self.comm, one, place)
        except (SceneError, SolverError) as error:
            return Done(self.plan.run(choice, 0), {}, 0.0, 0.0, 0, 0, f"it cannot be set up: {error}")
        return done

    def look(self) -> None:
        """Compare all runs with the truth as it is known now; on rank 0, which has the histories."""
        if self.comm.rank == 0:
            self.truth = stated_truth(self.plan) or observed_truth(self.plan)
            if self.truth is not None:
                judge(self.plan, self.truth)

    def costs(self) -> dict[int, float]:
        """Number of a choice that is still run -> seconds that it would need for an error between the scene's own and
        the best. Collective.
        """
        found = {}
        if self.comm.rank == 0:
            plan = self.plan
            newest = [one.errors[-1] for one in plan.candidates if one.errors]
            own = plan.candidates[0].errors
            # between what the scene has and what can be had
            wanted = (min(newest) * (own[-1] if own else min(newest))) ** 0.5
            alive = [i for i, one in enumerate(plan.candidates) if one.dropped is None and one.errors]
            found = {i: time_to(plan.candidates[i], max(wanted, 1e-300), plan.scene.dimension) for i in alive}
        result: dict[int, float] = self.comm.bcast(found)
        return result

    def halve(self, level: int) -> None:
        """Drop the worse half; the scene itself is kept. Collective."""
        costs = self.costs()
        order = sorted(costs, key=lambda number: costs[number])
        for number in order[max(2, (len(order) + 1) // 2) :]:
            if number:
                share = costs[number] / max(costs[order[0]], 1e-300)
                times = f"{share:.2g} times" if share < 1000.0 else "more than 1000 times"
                words = f"{times} the time of the best for the same error at level {level + 1}"
                self.plan.candidates[number].dropped = words

    def combine(self) -> None:
        """Take the changes that gain most together, of each axis the best, as further choices. Collective."""
        costs = self.costs()
        own = costs.get(0, float("inf"))
        gains: list[Candidate] = []
        for number in sorted(costs, key=lambda number: costs[number]):
            one = self.plan.candidates[number]
            taken = {axis for other in gains for axis in other.choice.axes}
            if number and costs[number] < own and not taken & set(one.choice.axes) and "method" not in one.choice.axes:
                gains.append(one)
        together = Choice()
        for count, one in enumerate(gains[:MOST_TOGETHER], 1):
            wider = together.together(one.choice)
            if count == 1:
                together = wider
                continue
            made = add(self.plan, wider)
            # what cannot be had together is left out, and the rest is tried without it
            together = wider if made is not None else together
