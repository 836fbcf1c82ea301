"""What each mechanism of the board model is worth: runs without it, beside the real board."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.experiments.parallel import ParallelRuns, Run, pooled
from reconros_zenoh.experiments.profile_file import varied
from reconros_zenoh.measure.compare import experiment_tables

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from reconros_zenoh.board.profile import Profile

COMPLETE = "nothing"

SEEDS = (0, 1)
"""More than one, because a board can lock into another pattern from another start."""

_EXECUTOR = ("model", "executor")
_DDS = ("model", "dds")
_LINK = ("model", "link")

MECHANISMS: dict[str, Mapping[tuple[str, ...], float | bool]] = {
    COMPLETE: {},
    "jitter of the DDS stack and of polling": {(*_DDS, "jitter"): 0.0, (*_EXECUTOR, "poll_jitter"): 0.0},
    "resending after a NACK": {(*_DDS, "nack_probability"): 0.0},
    "loss, repaired at the next heartbeat": {
        (*_DDS, "loss_probability"): 0.0,
        (*_DDS, "loss_probability_busy"): 0.0,
    },
    "stall of the DDS stack by reconfiguration": {
        (*_DDS, "stalled_by_reconfiguration"): False,
        (*_DDS, "recovery"): 0.0,
    },
    "polling of idle workers": {(*_EXECUTOR, "hardware_poll"): 0.0, (*_EXECUTOR, "software_poll"): 0.0},
    "link between board and desktop": {(*_LINK, "latency"): 0.0, (*_LINK, "per_byte"): 0.0},
}
"""What is switched off, with the values of the profile that switch it off. The order in which the executor
visits the callbacks is part of the algorithm and has no switch."""


def runs_of_ablation(mappings: Mapping[str, Path]) -> int:
    """Return how many runs `ablate` makes."""
    return len(MECHANISMS) * len(mappings) * len(SEEDS)


def ablate(
    profile: Profile,
    mappings: Mapping[str, Path],
    requests: int,
    on_run: Callable[[], None],
) -> dict[str, Any]:
    """Return `requests`, `seeds` and per entry of MECHANISMS the accuracy of the board without it.

    `variants` is a list of `off` and `accuracy` (as in `experiment_tables`, over the round trips of all SEEDS
    together), the complete board first. The profile needs a model. `on_run` is called after each of the
    `runs_of_ablation(mappings)` runs.
    """
    variants = []
    with ParallelRuns() as parallel:
        runs = parallel.records(
            Run(varied(profile, changes), mapping, requests, seed)
            for changes in MECHANISMS.values()
            for mapping in mappings.values()
            for seed in SEEDS
        )
        for off in MECHANISMS:
            records = {}
            for mapping in mappings:
                of_seeds = []
                for _ in SEEDS:
                    of_seeds.append(next(runs))
                    on_run()
                records[mapping] = pooled(of_seeds)
            variants.append({"off": off, "accuracy": experiment_tables(records)["accuracy"]})
    return {"requests": requests, "seeds": list(SEEDS), "variants": variants}
