"""Computation graphs of any shape, and the reconstructed example of the paper."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from hypothesis import strategies as st

from reconros_zenoh.mapping.graph import ComputationGraph, Side, Topic

EXAMPLE = Path(str(files("reconros_zenoh") / "applications" / "graphs" / "mapping_example.yaml"))


@st.composite
def graphs(draw: st.DrawFn, max_topics: int = 6) -> ComputationGraph:
    """Return a graph of at most 8 nodes; some topics have no subscriber, some no size or rate."""
    nodes = draw(st.dictionaries(st.sampled_from("abcdefgh"), st.sampled_from(Side), min_size=1))
    names = st.sampled_from(sorted(nodes))
    topics = draw(
        st.lists(
            st.builds(
                Topic,
                name=st.sampled_from("ABCDEFa"),
                publishers=st.lists(names, min_size=1, max_size=3, unique=True).map(tuple),
                subscribers=st.lists(names, max_size=8, unique=True).map(tuple),
                size=st.none() | st.integers(1, 10**8),
                rate=st.none() | st.floats(0.1, 1000),
            ),
            max_size=max_topics,
            unique_by=lambda topic: topic.name,
        )
    )
    return ComputationGraph(nodes, tuple(topics))
