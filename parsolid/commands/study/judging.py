"""Observed orders, and whether each run did what the study states."""

from itertools import pairwise
from math import log
from typing import Any

from parsolid.commands.study.cases import Case
from parsolid.commands.study.launching import FAILED, FINISHED, REFUSED
from parsolid.commands.study.schema import Study

_ENDING = {"stable": FINISHED, "failure": FAILED, "refused": REFUSED}


def judge(study: Study, cases: list[Case]) -> None:
    """Fill in `orders` and `faults` of all cases that have a record."""
    for line in lines_of(cases).values():
        for coarse, fine in pairwise(line):
            fine.orders = observed_orders(coarse, fine)
    for case in cases:
        if case.record:
            case.faults = [*_ending_faults(case), *_number_faults(study, case)]


def lines_of(cases: list[Case]) -> dict[tuple[Any, ...], list[Case]]:
    """Cases with a spacing and errors, by the line they are on, from coarse to fine."""
    lines: dict[tuple[Any, ...], list[Case]] = {}
    for case in cases:
        if case.spacing is not None and case.measures.get("errors"):
            lines.setdefault(case.line, []).append(case)
    return {name: sorted(line, key=lambda case: -(case.spacing or 0.0)) for name, line in lines.items()}


def observed_orders(coarse: Case, fine: Case) -> dict[str, float]:
    """log(error ratio) / log(spacing ratio) of two runs, by the error's name."""
    spacings: Any = coarse.spacing, fine.spacing
    ratio = log(spacings[0] / spacings[1])
    before, after = coarse.measures["errors"], fine.measures["errors"]
    return {
        name: log(before[name] / after[name]) / ratio
        for name in after
        if ratio > 0.0 and before.get(name) and after[name]
    }


def _ending_faults(case: Case) -> list[str]:
    record, wanted = case.record, _ENDING[case.expect or "stable"]
    faults = []
    if record["status"] != wanted:
        message = (record["message"] or "").split("\n")[0]
        faults.append(f"{record['status']}, not {wanted}" + (f": {message}" if message else ""))
    elif not record["clean"]:
        faults.append("not one clean message" if record["message"] else "a message though it finished")
    if record["not_finite"]:
        faults.append(f"not finite: {', '.join(record['not_finite'])}")
    return faults


def _number_faults(study: Study, case: Case) -> list[str]:
    """Bounds, other codes and orders that a finished run misses."""
    if case.record["status"] != FINISHED:
        return []
    faults = []
    for name, bound in case.bounds.items():
        value = value_of(case, name)
        if value is None or not value <= bound:
            faults.append(f"{name} {_told(value)}, at most {bound:g}")
    for name, ratio in other_code_ratios(case).items():
        allowed = 1.0 if name == "processor_seconds" else study.allowed
        if not ratio <= allowed:
            faults.append(f"{name} {ratio:.2f} of the other code, at most {allowed:g}")
    for name, least in case.series.orders.items():
        if name in case.orders and not case.orders[name] >= least:
            faults.append(f"order of {name} {case.orders[name]:.2f}, at least {least:g}")
    return faults


def other_code_ratios(case: Case) -> dict[str, float]:
    """What the run has over what the other code reached, by name; without what the run has not."""
    values = {name: value_of(case, name) for name in case.other_code}
    return {name: value / case.other_code[name] for name, value in values.items() if value is not None}


def value_of(case: Case, name: str) -> float | None:
    """A measure or an error of a run."""
    errors = case.measures.get("errors") or {}
    return errors[name] if name in errors else case.measures.get(name)


def _told(value: float | None) -> str:
    return "not known" if value is None else f"{value:.3g}"
