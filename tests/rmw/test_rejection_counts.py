"""Counting and logging of bad messages."""

from __future__ import annotations

from threading import Barrier, Thread
from typing import TYPE_CHECKING

from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.rmw import rejections
from reconros_zenoh.rmw.rejections import Rejections

if TYPE_CHECKING:
    import pytest

SHORT = BadMessageError("truncated", "7 bytes")
FOREIGN = BadMessageError("foreign_domain", "sent in domain 42")


def messages(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records]


def test_the_first_of_a_kind_from_a_sender_is_logged_and_all_are_counted(
    caplog: pytest.LogCaptureFixture,
) -> None:
    refused = Rejections()
    for sender in ("aa", "bb", "aa"):
        refused.add("0/angle", sender, SHORT)
    refused.add("0/angle", "aa", FOREIGN)
    assert refused.counts() == {"truncated": 3, "foreign_domain": 1}
    more = "; more of its kind are counted only"
    assert messages(caplog) == [
        f"refused a message on 0/angle from publisher aa (truncated: 7 bytes){more}",
        f"refused a message on 0/angle from publisher bb (truncated: 7 bytes){more}",
        f"refused a message on 0/angle from publisher aa (foreign_domain: sent in domain 42){more}",
    ]


def test_without_a_sender_the_key_stands_for_it(caplog: pytest.LogCaptureFixture) -> None:
    refused = Rejections()
    for key in ("0/angle", "0/image", "0/angle"):
        refused.add(key, None, SHORT)
    assert refused.counts() == {"truncated": 3}
    assert [text.split(" (")[0] for text in messages(caplog)] == [
        "refused a message on 0/angle from an unknown sender",
        "refused a message on 0/image from an unknown sender",
    ]


def test_so_many_senders_that_no_more_are_logged(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rejections, "_SENDERS_NAMED", 2)
    refused = Rejections()
    for sender in ("aa", "bb", "cc", "dd"):
        refused.add("0/angle", sender, SHORT)
    refused.add("0/angle", "aa", FOREIGN)
    assert refused.counts() == {"truncated": 4, "foreign_domain": 1}
    first, last, other = messages(caplog)
    assert first.endswith("counted only")
    assert last.endswith(
        "publisher bb (truncated: 7 bytes); more of its kind are counted only, whoever sends "
        "them: no more senders are named"
    )
    assert "publisher aa (foreign_domain" in other


def test_the_counts_do_not_change_behind_the_readers_back() -> None:
    refused = Rejections()
    refused.add("0/angle", "aa", SHORT)
    counts = refused.counts()
    refused.add("0/angle", "aa", SHORT)
    assert counts == {"truncated": 1}


def test_two_threads_count_together(caplog: pytest.LogCaptureFixture) -> None:
    refused = Rejections()
    together = Barrier(2, timeout=30)

    def add() -> None:
        together.wait()
        for _ in range(200):
            refused.add("0/angle", "aa", SHORT)

    threads = [Thread(target=add) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert refused.counts() == {"truncated": 400}
    assert len(messages(caplog)) == 1
