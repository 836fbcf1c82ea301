"""The compact QoS of graph tokens."""

from __future__ import annotations

import re

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from reconros_zenoh.errors import UsageError
from reconros_zenoh.ros.qos import INFINITE_NS, Durability, History, Liveliness, QosProfile, Reliability

durations = st.integers(0, INFINITE_NS) | st.just(INFINITE_NS)
profiles = st.builds(
    QosProfile,
    st.sampled_from(Reliability),
    st.sampled_from(Durability),
    st.sampled_from(History),
    st.integers(0, 2**64 - 1) | st.integers(0, 50),
    durations,
    durations,
    st.sampled_from(Liveliness),
    durations,
)

GOLDEN = [
    (QosProfile(), "::,10:,:,:,,"),
    (QosProfile(depth=42), "::,:,:,:,,"),
    (QosProfile(reliability=Reliability.BEST_EFFORT), "2::,10:,:,:,,"),
    (QosProfile(durability=Durability.TRANSIENT_LOCAL, depth=1), ":1:,1:,:,:,,"),
    (QosProfile(history=History.KEEP_ALL, depth=42), "::2,:,:,:,,"),
    (QosProfile(reliability=Reliability.BEST_EFFORT, depth=5), "2::,5:,:,:,,"),
    (QosProfile(deadline_ns=1_500_000_000), "::,10:1,500000000:,:,,"),
    (QosProfile(lifespan_ns=7), "::,10:,:0,7:,,"),
    (
        QosProfile(liveliness=Liveliness.MANUAL_BY_TOPIC, lease_ns=2_000_000_000),
        "::,10:,:,:3,2,0",
    ),
    # Each half of a duration is left out by itself.
    (QosProfile(deadline_ns=854_775_807), "::,10:0,:,:,,"),
]


@pytest.mark.parametrize(("profile", "text"), GOLDEN)
def test_golden(profile: QosProfile, text: str) -> None:
    assert profile.encode() == text
    assert QosProfile.decode(text) == profile


def test_words() -> None:
    assert QosProfile.of_words({}) == QosProfile()
    assert QosProfile().words() == {
        "reliability": "reliable",
        "durability": "volatile",
        "history": "keep_last",
        "depth": 10,
    }


@given(profiles)
def test_words_say_what_they_are_said_of(profile: QosProfile) -> None:
    assume(0 < profile.depth < 2**31)
    again = QosProfile.of_words(profile.words())
    assert again == QosProfile(profile.reliability, profile.durability, profile.history, profile.depth)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ({"reliability": "yes"}, "reliability is 'yes'. Write reliable or best_effort."),
        ({"history": 1}, "history is 1. Write keep_last or keep_all."),
        ({"depth": 0}, "depth is 0. Write a number from 1 to 2147483647."),
        ({"depth": 2**31}, "depth is 2147483648."),
        ({"depth": "10"}, "depth is '10'."),
        (
            {"lifespan": 5},
            "there is no QoS policy 'lifespan'. Known: reliability, durability, history, depth.",
        ),
    ],
)
def test_words_that_say_nothing(words: dict[str, str | int], says: str) -> None:
    with pytest.raises(UsageError, match=f"^{re.escape(says)}"):
        QosProfile.of_words(words)


def test_fields_that_are_spelled_out_may_be_defaults() -> None:
    assert QosProfile.decode("1:2:1,42:9223372036,854775807:,:1,,") == QosProfile(depth=42)


def test_what_an_endpoint_leaves_open_is_the_default() -> None:
    """Best available, as rmw_zenoh writes it, and the defaults of the system."""
    assert QosProfile.decode("4:4:,10:,854775806:,:5,,854775806").words() == QosProfile().words()
    assert QosProfile.decode("0:0:0,10:,:,:0,,") == QosProfile()


@given(profiles)
def test_round_trip(profile: QosProfile) -> None:
    assert QosProfile.decode(profile.encode()) == profile


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "not of the form"),
        ("::,10", "not of the form"),
        ("::,10:,:,:,,:", "not of the form"),
        ("::10:,:,:,,", "not of the form"),
        ("3::,10:,:,:,,", "'3' is no reliability"),
        (":x:,10:,:,:,,", "'x' is no durability"),
        ("::3,10:,:,:,,", "'3' is no history"),
        ("::,10:,:,:7,,", "'7' is no liveliness"),
        ("::,ten:,:,:,,", "'ten' is not a number"),
        ("::,-1:,:,:,,", "'-1' is not a number"),
        ("::,٣:,:,:,,", "is not a number"),
        ("::,18446744073709551616:,:,:,,", "is not a number"),
        (f"::,{'9' * 5000}:,:,:,,", "is not a number"),
        ("::,10:9223372037,0:,:,,", "'9223372037' is not a number"),
        ("::,10:,:1,1000000000:,,", "'1000000000' is not a number"),
    ],
)
def test_nonsense_is_refused(text: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        QosProfile.decode(text)


@given(st.text(alphabet=":,0129x-", max_size=20))
def test_any_text_gives_a_profile_or_a_value_error(text: str) -> None:
    try:
        profile = QosProfile.decode(text)
    except ValueError:
        return
    assert QosProfile.decode(profile.encode()) == profile


def test_a_profile_of_qos_is_made_of_its_policies() -> None:
    for policies, told in {
        ("reliability", "best_effort"): "Write Reliability.RELIABLE or Reliability.BEST_EFFORT.",
        ("durability", 1): "Write Durability.TRANSIENT_LOCAL or Durability.VOLATILE.",
        ("history", None): "Write History.KEEP_LAST or History.KEEP_ALL.",
        ("liveliness", "automatic"): "Write Liveliness.AUTOMATIC or Liveliness.MANUAL_BY_TOPIC.",
        ("depth", "10"): "Write a whole number from 0 to 18446744073709551615.",
        ("depth", 1.5): "Write a whole number from 0 to 18446744073709551615.",
        ("depth", -1): "Write a whole number from 0 to 18446744073709551615.",
        ("depth", 2**64): "Write a whole number from 0 to 18446744073709551615.",
        ("deadline_ns", -1): "Write a whole number from 0 to 9223372036854775807.",
        ("lifespan_ns", 0.5): "Write a whole number from 0 to 9223372036854775807.",
        ("lease_ns", 2**63): "Write a whole number from 0 to 9223372036854775807.",
    }.items():
        name, value = policies
        with pytest.raises(UsageError) as caught:
            QosProfile(**{name: value})  # type: ignore[arg-type]
        assert str(caught.value) == f"{name} is {value!r}. {told}"
