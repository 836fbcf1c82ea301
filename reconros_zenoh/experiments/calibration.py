"""Fitting the calibrated constants of a board profile to measured round trips.

Published and assumed constants are held. The objective is the sum of |log(ours / measured)| over the
quartiles of all cells (mapping and client). It is found by simulation, so it is neither smooth nor without
noise: the search uses no derivatives, the same seeds all along, and takes a step only if it gains more than
the objective differs between other seeds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pydantic import BaseModel

from reconros_zenoh.board.quantity import Count, Fraction, Quantity, Share
from reconros_zenoh.errors import UsageError
from reconros_zenoh.experiments.interruption import until_interrupted
from reconros_zenoh.experiments.measured import quartiles_ms
from reconros_zenoh.experiments.parallel import ParallelRuns, Run, pooled
from reconros_zenoh.experiments.profile_file import varied

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import numpy.typing as npt

    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.experiments.measured import MeasuredMapping
    from reconros_zenoh.measure.record import Record

SAMPLES = 4
"""Evaluations with seeds of their own that give the noise and the figures before and after; the search goes
on with the seeds of the first."""

_SEEDS = 3  # per evaluation: a board can lock into another pattern from another start

_FIRST_STEP = 0.2
_LAST_STEP = 0.02
_SENSITIVITY_STEP = 0.2
# Where a message is resent with certainty it never arrives.
_LARGEST_PROBABILITY = 0.9
# A client that gets no answer at all counts like one whose answers come at its limit.
_NO_ANSWER_MS = 2000.0
_LEAST_MS = 1e-3


@dataclass(frozen=True, slots=True)
class Constant:
    """A calibrated constant: its place in the profile's file, its unit and value, and the most it may be."""

    place: tuple[str, ...]
    unit: str
    value: float
    most: float

    @property
    def name(self) -> str:
        """The place as a user writes it, without the table `model`."""
        return ".".join(self.place[1:])


@dataclass(frozen=True, slots=True)
class FittedConstant:
    """A constant and what became of it.

    `sensitivity` is the most that the objective changes when the constant is 20 % more or less. Data that
    change it no more than the seeds do leave the constant undetermined. Both are None when the calibration
    was interrupted before.
    """

    constant: Constant
    value: float
    sensitivity: float | None
    determined: bool | None


@dataclass(frozen=True, slots=True)
class FittedCell:
    """A cell's quartiles [ms] as measured and, as the mean of all samples, before and after."""

    mapping: str
    client: str
    measured_ms: tuple[float, ...]
    before_ms: tuple[float, ...]
    after_ms: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Calibration:
    """The fitted profile and how the search went; objective and noise as the module describes them."""

    profile: Profile
    constants: tuple[FittedConstant, ...]
    cells: tuple[FittedCell, ...]
    before: float
    after: float
    noise: float
    evaluations: int
    interrupted: bool


class _Evaluation(NamedTuple):
    """The quartiles of all cells for one set of values and one set of seeds, and the objective."""

    cells: dict[tuple[str, str], npt.NDArray[np.float64]]
    objective: float


def calibrated_constants(profile: Profile) -> list[Constant]:
    """Return the constants of the profile whose basis is `calibrated`, in the order of its file.

    Those that are 0 are left as they are, because 0 switches a mechanism off; so are whole numbers of things.
    Raise UsageError when there is none.
    """
    constants = list(_constants(profile.model, ("model",)))
    if not constants:
        raise UsageError(
            f'profile {profile.name!r} has no constant to fit. Write basis = "calibrated" beside those that '
            "the measurements are to determine."
        )
    return constants


def planned_evaluations(constants: Sequence[Constant], evaluations: int) -> int:
    """Return how many evaluations a calibration takes at most, `evaluations` of them for the search."""
    return evaluations + 2 * SAMPLES + 2 * len(constants)


def calibrate(
    profile: Profile,
    measured: Sequence[MeasuredMapping],
    evaluations: int,
    requests: int,
    seed: int,
    on_evaluation: Callable[[], None],
) -> Calibration:
    """Return the profile fitted to what was measured; the same arguments give the same result anywhere.

    A pattern search along one constant after the other, in steps of its logarithm: it tries a step up and a
    step down, doubles the step where that helped and halves it where it did not, and ends after that many
    `evaluations` or when all steps are below 2 %. `on_evaluation` is called after each evaluation (three
    runs of different seeds under each measured mapping).

    Ctrl-C ends the search with the best values so far; before it has begun it raises KeyboardInterrupt.
    """
    constants = calibrated_constants(profile)
    with ParallelRuns() as parallel:

        def evaluate(points: Sequence[tuple[Sequence[float], int]]) -> list[_Evaluation]:
            runs = parallel.records(
                Run(_profile(profile, constants, values), mapping.mapping, requests, each)
                for values, sample in points
                for mapping in measured
                for each in range(seed + sample * _SEEDS, seed + (sample + 1) * _SEEDS)
            )
            found = []
            for _ in points:
                found.append(
                    _compare(measured, [pooled([next(runs) for _ in range(_SEEDS)]) for _ in measured])
                )
                on_evaluation()
            return found

        start = [constant.value for constant in constants]
        before = evaluate([(start, each) for each in range(SAMPLES)])
        noise = float(np.std([each.objective for each in before], ddof=1))
        search = _Search(constants, noise, start, before[0])
        after: list[_Evaluation] = []
        around: list[_Evaluation] = []
        with until_interrupted() as interruption:
            search.run(evaluations, evaluate)
            after = evaluate([(search.values, each) for each in range(SAMPLES)])
            around = evaluate(
                [
                    (_moved(constants, search.values, index, factor), 0)
                    for index in range(len(constants))
                    for factor in (1 + _SENSITIVITY_STEP, 1 - _SENSITIVITY_STEP)
                ]
            )
    after = after or [search.best]
    changes = [abs(each.objective - search.best.objective) for each in around]
    sensitivities = [max(changes[2 * index : 2 * index + 2], default=None) for index in range(len(constants))]
    return Calibration(
        profile=_profile(profile, constants, search.values),
        constants=tuple(
            FittedConstant(constant, value, sensitivity, None if sensitivity is None else sensitivity > noise)
            for constant, value, sensitivity in zip(constants, search.values, sensitivities, strict=True)
        ),
        cells=tuple(
            FittedCell(
                mapping.name,
                client,
                tuple(quartiles.tolist()),
                _mean_quartiles(before, (mapping.name, client)),
                _mean_quartiles(after, (mapping.name, client)),
            )
            for mapping in measured
            for client, quartiles in mapping.quartiles_ms.items()
        ),
        before=float(np.mean([each.objective for each in before])),
        after=float(np.mean([each.objective for each in after])),
        noise=noise,
        evaluations=search.used + len(before) + len(after) + len(around),
        interrupted=interruption.happened,
    )


@dataclass(slots=True)
class _Search:
    """The best values so far, what came of them, and how many evaluations it took to find them."""

    constants: Sequence[Constant]
    noise: float
    values: list[float]
    best: _Evaluation
    used: int = 0

    def run(
        self,
        evaluations: int,
        evaluate: Callable[[Sequence[tuple[Sequence[float], int]]], list[_Evaluation]],
    ) -> None:
        """Search until so many evaluations are used or all steps are small."""
        steps = [_FIRST_STEP] * len(self.constants)
        while self.used + 2 <= evaluations and max(steps) >= _LAST_STEP:
            for index, step in enumerate(steps):
                if step < _LAST_STEP or self.used + 2 > evaluations:
                    continue
                tried = [
                    _moved(self.constants, self.values, index, math.exp(signed)) for signed in (step, -step)
                ]
                found = evaluate([(point, 0) for point in tried])
                self.used += len(tried)
                least, values = min(zip(found, tried, strict=True), key=lambda each: each[0].objective)
                if least.objective < self.best.objective - self.noise:
                    self.values, self.best = values, least
                    steps[index] *= 2
                else:
                    steps[index] /= 2


def _constants(part: object, place: tuple[str, ...]) -> Iterator[Constant]:
    match part:
        case Quantity():
            if part.basis == "calibrated" and part.value > 0 and not isinstance(part, Count):
                yield Constant(place, part.unit, part.value, _most(part))
        case BaseModel():
            for name in type(part).model_fields:
                yield from _constants(getattr(part, name), (*place, name))
        case dict():
            for name, inner in part.items():
                yield from _constants(inner, (*place, name))
        case tuple():
            for index, inner in enumerate(part):
                yield from _constants(inner, (*place, str(index)))


def _most(quantity: Quantity) -> float:
    match quantity:
        case Share():
            return 1.0
        case Fraction():
            return max(_LARGEST_PROBABILITY, quantity.value)
        case _:
            return math.inf


def _moved(constants: Sequence[Constant], values: Sequence[float], index: int, factor: float) -> list[float]:
    """Return the values with one of them times the factor, with the four digits that the file will show."""
    moved = list(values)
    moved[index] = float(f"{min(constants[index].most, values[index] * factor):.4g}")
    return moved


def _profile(profile: Profile, constants: Sequence[Constant], values: Sequence[float]) -> Profile:
    return varied(profile, {constant.place: value for constant, value in zip(constants, values, strict=True)})


def _compare(measured: Sequence[MeasuredMapping], records: Sequence[Mapping[str, Record]]) -> _Evaluation:
    cells = {}
    objective = 0.0
    for mapping, clients in zip(measured, records, strict=True):
        for client, real in mapping.quartiles_ms.items():
            values_ms = clients[client].values_ms
            ours = quartiles_ms(values_ms) if values_ms.size else np.full(real.shape, _NO_ANSWER_MS)
            cells[mapping.name, client] = ours
            # A time may be a whole number of seconds, which is 0 modulo 1 s.
            objective += float(np.abs(np.log(np.maximum(ours, _LEAST_MS) / real)).sum())
    return _Evaluation(cells, objective)


def _mean_quartiles(evaluations: Sequence[_Evaluation], cell: tuple[str, str]) -> tuple[float, ...]:
    means: npt.NDArray[np.float64] = np.mean([each.cells[cell] for each in evaluations], axis=0)
    return tuple(means.tolist())
