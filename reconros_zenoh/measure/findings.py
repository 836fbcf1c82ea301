"""What an experiment says, in sentences made from its figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from reconros_zenoh.measure.compare import GOOD_ERROR
from reconros_zenoh.measure.statistics import format_error, format_ms

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

ALIKE = 0.06
"""Medians this close are called alike: the real board's own differ by up to 6 % from one day to another."""


LATE_US = 500.0
"""Round trips of the wall and the virtual clock are expected to agree to half a millisecond."""


class Finding(NamedTuple):
    """One sentence about a subject; `warning` if it puts the figures in doubt."""

    subject: str
    sentence: str
    warning: bool = False


def findings(experiment: Mapping[str, Any]) -> list[Finding]:
    """Return the answers of an experiment: the best mapping per client, the real board, losses, the host."""
    cells = {
        (mapping, client): cell
        for mapping, row in experiment["mappings"].items()
        for client, cell in row.items()
    }
    clients = dict.fromkeys(client for _, client in cells)
    found = [
        _best_mapping(
            client, {mapping: cell["median_ms"] for (mapping, c), cell in cells.items() if c == client}
        )
        for client in clients
    ]
    if errors := {
        key: cell["median_error"] for key, cell in cells.items() if cell["median_error"] is not None
    }:
        found.append(_real_board(errors))
    found.append(_losses(cells.values()))
    found.append(host_finding(experiment))
    return found


def _best_mapping(client: str, medians: Mapping[str, float | None]) -> Finding:
    known = sorted((median, mapping) for mapping, median in medians.items() if median is not None)
    if not known:
        return Finding(client, "no answer under any mapping.", warning=True)
    if len(medians) == 1:
        median, mapping = known[0]
        return Finding(client, f"median {format_ms(median)} ms under {mapping}.")
    best, (longest, slowest) = [known[0]], known[-1]
    best += [entry for entry in known[1:] if entry[0] <= (1 + ALIKE) * known[0][0]]
    names = _listed(mapping for _, mapping in best)
    shown = _listed(format_ms(median) for median, _ in best)
    if len(best) == len(medians):
        return Finding(client, f"the mapping makes no difference: medians {shown} ms under {names}.")
    sentence = f"shortest under {names}, median {shown} ms"
    if len(best) < len(known):
        ratio = f", {longest / known[0][0]:.1f} times as long" if known[0][0] else ""
        sentence += f"; longest under {slowest}, {format_ms(longest)} ms{ratio}"
    if silent := [mapping for mapping, median in medians.items() if median is None]:
        return Finding(client, f"{sentence}; no answer under {_listed(silent)}.", warning=True)
    return Finding(client, f"{sentence}.")


def _real_board(errors: Mapping[tuple[str, str], float]) -> Finding:
    far = {key: error for key, error in errors.items() if abs(error) > GOOD_ERROR}
    sentence = (
        f"{len(errors) - len(far)} of {len(errors)} medians lie within {GOOD_ERROR:.0%} of the real board's"
    )
    sentence = sentence.replace("%", " %")
    if far:
        furthest = sorted(far.items(), key=lambda item: -abs(item[1]))[:3]
        sentence += "; the furthest off: " + _listed(
            f"{client} under {mapping} ({format_error(error)})" for (mapping, client), error in furthest
        )
    return Finding("real board", sentence + ".")


def _losses(cells: Iterable[Mapping[str, int]]) -> Finding:
    answers, lost, wrong = (sum(cell[key] for cell in cells) for key in ("n", "lost", "wrong"))
    if lost or wrong or not answers:
        return Finding(
            "requests", f"{answers} answered, {wrong} of them wrongly, and {lost} lost.", warning=True
        )
    return Finding("requests", f"all {answers} were answered, and every answer was right.")


def host_finding(experiment: Mapping[str, Any]) -> Finding:
    """Return whether the host was fast enough for the model."""
    if experiment["clock"] == "virtual":
        return Finding(
            "host", "time is virtual: the speed of the computer that ran this has no part in the figures."
        )
    if experiment["host"]["lag_p50_us"] is None:
        return Finding("host", "whether it kept up is not known: no board has told it.", warning=True)
    troubles = host_troubles(experiment["host"])
    if not troubles:
        return Finding("host", "it kept up with the modelled times: no overrun.")
    sentence = f"{' '.join(troubles)} The figures of this run are partly those of the host rather than of the"
    return Finding("host", f"{sentence} board.", warning=True)


def host_troubles(host: Mapping[str, Any]) -> list[str]:
    """Return in what the host was too slow for the model, a sentence each."""
    troubles = []
    if overruns := host["overruns"]:
        often = "Once" if overruns == 1 else f"{overruns} times"
        troubles.append(
            f"{often} a computation took longer on this computer than the board is modelled to need."
        )
    late_us = host.get("lag_p99_us")
    if late_us is not None and late_us > LATE_US:
        troubles.append(
            f"One event in a hundred of the board came more than {late_us / 1e3:.1f} ms late: the "
            "tails of short round trips are longer by about that."
        )
    return troubles


def _listed(items: Iterable[str]) -> str:
    *front, last = items
    return f"{', '.join(front)} and {last}" if front else last
