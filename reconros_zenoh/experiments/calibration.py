"""Fitting the calibrated constants of a board profile to measured round trips.

Published and assumed constants are held. The residuals are log(ours / measured) of the quartiles of all cells
(mapping and client), the objective is the sum of their absolute values. They are found by simulation, so they
are neither smooth nor without noise: derivatives are taken over wide steps and with the same seeds, what they
promise is judged with others, and the figures before and after are of seeds that the search never used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

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
"""Evaluations with seeds of their own that give the noise and the figures before and after."""

_SEEDS = 3  # per evaluation: a board can lock into another pattern from another start

# Steps are differences of logarithms: 0.2 is a fifth more, or less.
_FIRST_STEP = 0.2
_LAST_STEP = 0.02
_LARGEST_STEP = math.log(2)
_SENSITIVITY_STEP = 0.2
_CLEARLY = 2.0
# How much of the way that the derivatives promise is tried, and with how many seeds of their own.
_FRACTIONS = (1.0, 0.5, 0.25)
_JUDGES = 2
# How much each constant is held where it is, beside what the residuals ask for.
_DAMPING = 1.0
_REWEIGHTINGS = 10
_SMALL_RESIDUAL = 0.02
# Quartiles can be the same for some seeds: no change below half a per cent is taken for more than noise.
_LEAST_NOISE = 0.005
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

    `sensitivity` is how much the quartiles change when the constant is 20 % more instead of less, as a
    multiple of what they change from seed to seed (root mean square of all). Where it is not clearly above 1
    the data leave the constant undetermined. Both are None when the calibration was interrupted before.
    """

    constant: Constant
    value: float
    sensitivity: float | None

    @property
    def determined(self) -> bool | None:
        """Whether the measurements determine the constant."""
        return None if self.sensitivity is None else self.sensitivity > _CLEARLY


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
    """The quartiles of all cells for one set of values and one set of seeds, and all their residuals."""

    cells: dict[tuple[str, str], npt.NDArray[np.float64]]
    residuals: npt.NDArray[np.float64]

    @property
    def objective(self) -> float:
        """The sum of the absolute values of the residuals."""
        return float(np.abs(self.residuals).sum())


_Evaluate: TypeAlias = "Callable[[Sequence[tuple[Sequence[float], int]]], list[_Evaluation]]"
"""Returns an evaluation for each pair of values and a number that chooses the seeds."""


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


def planned_evaluations(constants: Sequence[Constant], rounds: int) -> int:
    """Return how many evaluations a calibration with so many rounds takes at most."""
    return rounds * (2 * len(constants) + _JUDGES * (1 + len(_FRACTIONS))) + 2 * SAMPLES + 2 * len(constants)


def calibrate(
    profile: Profile,
    measured: Sequence[MeasuredMapping],
    rounds: int,
    requests: int,
    seed: int,
    on_evaluation: Callable[[], None],
) -> Calibration:
    """Return the profile fitted to what was measured; the same arguments give the same result.

    At most so many `rounds` of damped Gauss-Newton steps, see `_Search`; where they end with something worse
    than the profile, that is kept. `on_evaluation` is called after each evaluation (three runs of different
    seeds under each measured mapping).

    Ctrl-C ends the search with the best values so far; before it has begun it raises KeyboardInterrupt.
    """
    constants = calibrated_constants(profile)
    with ParallelRuns() as parallel:
        evaluations = 0

        def evaluate(points: Sequence[tuple[Sequence[float], int]]) -> list[_Evaluation]:
            nonlocal evaluations
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
                evaluations += 1
                on_evaluation()
            return found

        start = [constant.value for constant in constants]
        before = evaluate([(start, each) for each in range(SAMPLES)])
        search = _Search(constants, start, before)
        after: list[_Evaluation] = []
        around: list[_Evaluation] = []
        with until_interrupted() as interruption:
            search.run(rounds, evaluate)
            after = evaluate([(search.values, each) for each in range(SAMPLES)])
            if _mean_objective(after) > _mean_objective(before):
                search.values, after = start, before
            around = evaluate([(each, 0) for each in _around(constants, search.values, _SENSITIVITY_STEP)])
    after = after or search.best
    variances = [np.var([each.objective for each in some], ddof=1) for some in (before, after)]
    sensitivities = _sensitivities(around, before, after) if around else [None] * len(constants)
    return Calibration(
        profile=_profile(profile, constants, search.values),
        constants=tuple(
            FittedConstant(constant, value, sensitivity)
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
        before=_mean_objective(before),
        after=_mean_objective(after),
        noise=math.sqrt(np.mean(variances)),
        evaluations=evaluations,
        interrupted=interruption.happened,
    )


@dataclass(slots=True)
class _Search:
    """The best values so far, and what came of them with some seeds.

    A round takes the derivatives of all residuals by the logarithm of each constant, from a step up and a
    step down; finds the way to the least sum of absolute residuals, if they were linear; and goes all of it,
    a half or a quarter, whichever is best with other seeds. Where none of them is better than to stay, the
    next round's steps are half as wide.
    """

    constants: Sequence[Constant]
    values: list[float]
    best: list[_Evaluation]

    def run(self, rounds: int, evaluate: _Evaluate) -> None:
        """Search for so many rounds, or until the steps are small."""
        step, sample = _FIRST_STEP, SAMPLES
        for _ in range(rounds):
            if step < _LAST_STEP:
                break
            way = self._way(step, sample, evaluate)
            tried = [self.values, *(_moved(self.constants, self.values, part * way) for part in _FRACTIONS)]
            judges = range(sample + 1, sample + 1 + _JUDGES)
            found = evaluate([(point, each) for point in tried for each in judges])
            judged = [found[index * _JUDGES : (index + 1) * _JUDGES] for index in range(len(tried))]
            least = min(range(len(tried)), key=lambda index: sum(each.objective for each in judged[index]))
            self.values, self.best = tried[least], judged[least]
            if least == 0:
                step /= 2
            sample = judges.stop

    def _way(self, step: float, sample: int, evaluate: _Evaluate) -> npt.NDArray[np.float64]:
        """Return by how much to change the logarithm of each constant."""
        points = _around(self.constants, self.values, step)
        residuals = np.array([each.residuals for each in evaluate([(point, sample) for point in points])])
        widths = np.diagonal(_between_sides(np.log(points)))
        derivatives = (_between_sides(residuals) / widths[:, np.newaxis]).T
        # Of points on both sides the mean is what would be found between them, with less noise.
        return _least_deviations(residuals.mean(axis=0), derivatives)


def _least_deviations(
    residuals: npt.NDArray[np.float64], derivatives: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Return the step with the least sum of |residuals + derivatives @ step|, damped.

    Iteratively reweighted least squares. What the residuals do not determine hardly moves.
    """
    weights = np.ones(residuals.size)
    damping = _DAMPING * np.eye(derivatives.shape[1])
    for _ in range(_REWEIGHTINGS):
        matrix = np.vstack([derivatives * weights[:, np.newaxis], damping])
        target = np.concatenate([-residuals * weights, np.zeros(len(damping))])
        step = np.linalg.lstsq(matrix, target, rcond=None)[0]
        weights = 1 / np.sqrt(np.abs(residuals + derivatives @ step) + _SMALL_RESIDUAL)
    clipped: npt.NDArray[np.float64] = np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
    return clipped


def _sensitivities(around: Sequence[_Evaluation], *samples: Sequence[_Evaluation]) -> list[float]:
    """Return the sensitivity to each constant from evaluations of two sides each, with the same seeds."""
    changes = _between_sides(np.array([each.residuals for each in around]))
    spreads = [np.var([each.residuals for each in some], axis=0, ddof=1) for some in samples]
    noise = np.maximum(np.sqrt(np.mean(spreads, axis=0)), _LEAST_NOISE)
    return [float(each) for each in np.sqrt(np.mean((changes / noise) ** 2, axis=1))]


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


def _around(constants: Sequence[Constant], values: Sequence[float], step: float) -> list[list[float]]:
    """Return for each constant the values with a step up of it, and those with a step down."""
    steps = step * np.eye(len(values))
    return [_moved(constants, values, each) for one in steps for each in (one, -one)]


def _between_sides(rows: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return for each constant the row of its step up minus that of its step down, of points of `_around`."""
    return rows[0::2] - rows[1::2]


def _moved(
    constants: Sequence[Constant], values: Sequence[float], step: npt.NDArray[np.float64]
) -> list[float]:
    """Return the values with their logarithms changed, with the four digits that the file will show."""
    return [
        float(f"{min(constant.most, value * math.exp(change)):.4g}") if change else value
        for constant, value, change in zip(constants, values, step, strict=True)
    ]


def _profile(profile: Profile, constants: Sequence[Constant], values: Sequence[float]) -> Profile:
    return varied(profile, {constant.place: value for constant, value in zip(constants, values, strict=True)})


def _compare(measured: Sequence[MeasuredMapping], records: Sequence[Mapping[str, Record]]) -> _Evaluation:
    cells = {}
    residuals = []
    for mapping, clients in zip(measured, records, strict=True):
        for client, real in mapping.quartiles_ms.items():
            values_ms = clients[client].values_ms
            ours = quartiles_ms(values_ms) if values_ms.size else np.full(real.shape, _NO_ANSWER_MS)
            cells[mapping.name, client] = ours
            # A time may be a whole number of seconds, which is 0 modulo 1 s.
            residuals.append(np.log(np.maximum(ours, _LEAST_MS) / real))
    return _Evaluation(cells, np.concatenate(residuals))


def _mean_objective(evaluations: Sequence[_Evaluation]) -> float:
    return float(np.mean([each.objective for each in evaluations]))


def _mean_quartiles(evaluations: Sequence[_Evaluation], cell: tuple[str, str]) -> tuple[float, ...]:
    means: npt.NDArray[np.float64] = np.mean([each.cells[cell] for each in evaluations], axis=0)
    return tuple(means.tolist())
