"""The transport over Zenoh; this file and zenoh_session.py are the only ones that import zenoh.

Callbacks run directly on Zenoh's network threads, all but two kinds: a thread of its own for each declaration
costs a change of thread per message (20 us of a round trip of 290 us).
"""

from __future__ import annotations

import json
import re
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, Self

import zenoh
from zenoh import ext
from zenoh.handlers import Callback

from reconros_zenoh.errors import TransportError
from reconros_zenoh.ros.qos import Durability, History, Reliability
from reconros_zenoh.transport.base import Reply, Sample
from reconros_zenoh.transport.changes import MatchingChanges, TokenChanges, gather
from reconros_zenoh.transport.frames import Frames
from reconros_zenoh.transport.guard import Closing, GuardedDeclaration
from reconros_zenoh.transport.key_expressions import check_concrete
from reconros_zenoh.transport.zenoh_session import (
    configuration,
    direct,
    is_of_this_host,
    open_pool,
    open_session,
    queued,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.ros.qos import QosProfile
    from reconros_zenoh.transport.base import OnMatching, OnReply, Parts, Request

_HEARTBEAT_S = 0.5
_NOBODY_THERE = "Unable to connect"


class ZenohRouter(Closing):
    """A Zenoh router inside this process: what `reconros router` and tests run instead of rmw_zenohd."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session

    @classmethod
    def open(cls, listen: str) -> Self:
        """Return a router that accepts sessions on `listen`.

        Raises TransportError when it cannot listen there, UsageError when `listen` is not an endpoint.
        """
        config = configuration("router", {"listen/endpoints": listen})
        config.insert_json5("scouting/delay", "0")  # else it scouts half a second for nobody
        try:
            return cls(open_session(config))
        except zenoh.ZError as error:
            remedy = "Use the router that runs there, or choose another endpoint."
            raise TransportError(f"no router can listen on {listen}: {_reason(error)}. {remedy}") from error

    def close(self) -> None:
        """Stop routing; sessions find a new router at the same endpoint by themselves. Idempotent."""
        with suppress(zenoh.ZError):  # it gives up waiting for its threads on a busy host
            self._session.close()  # type: ignore[no-untyped-call] # so is the stub


class ZenohTransport(Closing):
    """A `Transport` over a Zenoh session that rmw_zenoh sessions take for one of theirs.

    Close it: while somebody hears of `on_matching`, the process does not end by itself.
    """

    def __init__(self, session: zenoh.Session) -> None:
        self.session_id = str(session.zid())
        self.session = session
        self.declarations: set[_Declaration] = set()
        self.frames = Frames(open_pool)
        self._kept_keys: dict[str, zenoh.KeyExpr] = {}

    @classmethod
    def open(cls, router: str, *, timeout_s: float = 3.0, as_client: bool = False) -> Self:
        """Return a session that is connected to `router`, for which it waits at most `timeout_s`.

        With a router on the loopback it is a peer, as in rmw_zenoh. With any other, or `as_client`, it is a
        client, which listens nowhere: the router passes everything on. Whoever only asks is a client: a peer
        hears nothing of one that has stopped, which the router knows, and its end waits 10 s for it.
        Raises TransportError when no router answers or this host lacks something, UsageError when `router` is
        not an endpoint.
        """
        if is_of_this_host(router) and not as_client:
            config = configuration(
                "peer", {"connect/endpoints": router, "listen/endpoints": "tcp/127.0.0.1:0"}
            )
        else:  # a router lets peers speak to each other directly, which those of two loopbacks cannot
            config = configuration("client", {"connect/endpoints": router})
        config.insert_json5("connect/timeout_ms", json.dumps(max(1, round(timeout_s * 1000))))
        config.insert_json5("connect/exit_on_failure", "true")
        config.insert_json5("connect/retry", "{period_init_ms: 100, period_max_ms: 1000}")
        try:
            return cls(open_session(config))
        except zenoh.ZError as error:
            if str(error).startswith(_NOBODY_THERE):
                problem = f"no Zenoh router at {router}: start one with `reconros router --listen {router}`"
            else:
                remedy = "See what this host lacks: `ulimit -a`, `df /dev/shm`."
                problem = f"no Zenoh session can be opened: {_reason(error)}. {remedy}"
            raise TransportError(problem) from error

    def publish(self, key: str, qos: QosProfile, on_matching: OnMatching | None = None) -> _Publisher:
        """Declare a publisher, see `Transport.publish`."""
        return _Publisher(self, key, qos, on_matching)

    def subscribe(
        self, key: str, sink: Callable[[Sample], None], qos: QosProfile, usual_key: str | None = None
    ) -> _Declaration:
        """Declare a subscription, see `Transport.subscribe`."""
        declaration = _Declaration(self, key)
        if usual_key is not None:
            self._keep_route(usual_key)
        is_pattern = "*" in key

        def on_sample(sample: zenoh.Sample) -> None:
            with declaration.lock:  # this is `call`, written out because every message comes this way
                if not declaration.is_closed:
                    try:
                        came_on = str(sample.key_expr) if is_pattern else key
                        attachment = sample.attachment
                        beside = None if attachment is None else attachment.to_bytes()
                        sink(Sample(came_on, beside, memoryview(sample.payload.to_bytes())))
                    except Exception:  # noqa: BLE001 # as in `call`
                        declaration.log_failure()

        if qos.durability is Durability.TRANSIENT_LOCAL:
            reliable = qos.reliability is Reliability.RELIABLE
            declaration.add(
                ext.declare_advanced_subscriber,
                self.session,
                key,
                # It is locked while its callback runs, which would wait for itself if it published to it.
                queued(on_sample),
                history=ext.HistoryConfig(detect_late_publishers=True, max_samples=qos.depth),
                recovery=ext.RecoveryConfig(periodic_queries=None, heartbeat=True) if reliable else None,
                subscriber_detection=True,
            )
        else:
            declaration.add(self.session.declare_subscriber, key, direct(on_sample))
        return declaration

    def serve(self, key: str, sink: Callable[[Request], None], *, complete: bool = True) -> _Declaration:
        """Declare a server, see `Transport.serve`."""
        declaration = _Declaration(self, key)
        is_pattern = "*" in key

        def on_query(query: zenoh.Query) -> None:
            declaration.call(sink, _Request(str(query.key_expr) if is_pattern else key, query, self))

        handler = direct(on_query)
        declaration.add(self.session.declare_queryable, key, handler, complete=complete)
        return declaration

    def request(self, key: str, on_matching: OnMatching | None = None) -> _Querier:
        """Declare a querier, see `Transport.request`."""
        return _Querier(self, key, on_matching)

    def declare_token(self, key: str) -> _Declaration:
        """Declare a liveliness token, see `Transport.declare_token`."""
        declaration = _Declaration(self, key)
        declaration.add(self.session.liveliness().declare_token, key)
        return declaration

    def tokens(self, key: str, timeout_ns: int) -> list[str]:
        """Return the keys of the live tokens that match `key`: those heard of until none came for 100 ms.

        Deviation: no liveliness get, because in a new session it often lacks tokens, and sometimes later.
        """
        return gather(partial(self.watch_tokens, key), timeout_ns)

    def watch_tokens(self, key: str, on_change: Callable[[str, bool], None]) -> _Declaration:
        """Report tokens, see `Transport.watch_tokens`."""
        declaration = _Declaration(self, key)
        changes = TokenChanges(on_change)

        def on_sample(sample: zenoh.Sample) -> None:
            declaration.call(changes.report, str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        handler = direct(on_sample)
        declaration.add(self.session.liveliness().declare_subscriber, key, handler, history=True)
        return declaration

    def _keep_route(self, key: str) -> None:
        """Have Zenoh know at once who gets a message on `key`, until the session ends.

        For a key of which it only knows patterns it looks at all of them for each message, a tenth of a small
        round trip. Not taken back earlier: messages on their way to another subscription may rely on it.
        """
        if key not in self._kept_keys:
            try:
                self._kept_keys[key] = self.session.declare_keyexpr(key)
            except zenoh.ZError as error:
                raise _failure(f"{key} cannot be declared", error) from error

    def close(self) -> None:
        """Close every declaration and the session. Idempotent."""
        # Publishers last: without subscriptions Zenoh no longer waits for the interpreter (`watch_matching`).
        for declaration in sorted(self.declarations.copy(), key=lambda each: isinstance(each, _Publisher)):
            declaration.close()
        with suppress(zenoh.ZError):  # it gives up taking leave of a router whose host has vanished
            self.session.close()  # type: ignore[no-untyped-call] # so is the stub


class _Declaration(GuardedDeclaration):
    """Entities of the session that are undeclared together."""

    __slots__ = ("_entities", "_transport")

    def __init__(self, transport: ZenohTransport, key: str) -> None:
        super().__init__(key)
        self._transport = transport
        self._entities: list[Any] = []

    def add(self, declare: Callable[..., Any], *arguments: object, **options: object) -> Any:
        """Return the entity that `declare` declares; its callbacks may come before this returns."""
        try:
            entity = declare(*arguments, **options)
        except zenoh.ZError as error:
            raise _failure(f"{self.key} cannot be declared", error) from error
        self._entities.append(entity)
        self._transport.declarations.add(self)
        return entity

    def watch_matching(self, entity: zenoh.Publisher | zenoh.Querier, on_matching: OnMatching) -> None:
        """Tell `on_matching` whether `entity` has a counterpart."""
        changes = MatchingChanges(on_matching)
        # On a thread of its own: while an advanced publisher is undeclared it keeps the interpreter and waits
        # for the thread of Zenoh that would wait for the interpreter here (a standstill of 10 s).
        handler: Callback[zenoh.MatchingStatus] = Callback(
            lambda status: self.call(changes.report, status.matching), indirect=True
        )
        self.add(entity.declare_matching_listener, handler)
        status: Any = entity.matching_status  # a MatchingStatus; the stub says bool
        self.call(changes.start, status.matching)

    def withdraw(self) -> None:
        self._transport.declarations.discard(self)
        for entity in self._entities:
            # Unless the session has gone first, or another thread is sending with it and drops it at the end.
            with suppress(zenoh.ZError, RuntimeError):
                entity.undeclare()
        self._entities.clear()


class _Publisher(_Declaration):
    __slots__ = ("_join", "_put")

    def __init__(
        self, transport: ZenohTransport, key: str, qos: QosProfile, on_matching: OnMatching | None
    ) -> None:
        check_concrete(key)
        super().__init__(transport, key)
        reliable = qos.reliability is Reliability.RELIABLE
        block = reliable and qos.history is History.KEEP_ALL
        options: Any = {
            "congestion_control": zenoh.CongestionControl.BLOCK if block else zenoh.CongestionControl.DROP,
            "reliability": zenoh.Reliability.RELIABLE if reliable else zenoh.Reliability.BEST_EFFORT,
        }
        # An advanced publisher has no matching listener: a plain one beside it tells the same.
        publisher = self.add(transport.session.declare_publisher, key, **options)
        if on_matching is not None:
            self.watch_matching(publisher, on_matching)
        if qos.durability is Durability.TRANSIENT_LOCAL:
            heartbeat = ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=_HEARTBEAT_S)
            publisher = self.add(
                ext.declare_advanced_publisher,
                transport.session,
                key,
                cache=ext.CacheConfig(qos.depth),
                publisher_detection=True,
                sample_miss_detection=heartbeat if reliable else None,
                **options,
            )
        self._put = publisher.put
        self._join = transport.frames.join

    def put(self, parts: Parts, attachment: bytes | None) -> None:
        try:
            self._put(self._join(parts), attachment=attachment)
        except zenoh.ZError as error:
            raise _failure(f"a message on {self.key} cannot be sent", error) from error

    def withdraw(self) -> None:
        self._put = self._refuse
        super().withdraw()

    def _refuse(self, payload: object, *, attachment: object) -> None:  # noqa: ARG002 # stands in for `put`
        self.check_open()


class _Request:
    __slots__ = ("_query", "_transport", "attachment", "key")

    def __init__(self, key: str, query: zenoh.Query, transport: ZenohTransport) -> None:
        self.key = key
        self.attachment = _bytes(query.attachment)
        self._query: zenoh.Query | None = query
        self._transport = transport

    def read(self) -> memoryview:
        return memoryview(_bytes(self._open().payload) or b"")

    def reply(self, parts: Parts, attachment: bytes | None) -> None:
        payload = self._transport.frames.join(parts)
        self._answer(lambda query: query.reply(self.key, payload, attachment=attachment))

    def reply_error(self, text: str) -> None:
        self._answer(lambda query: query.reply_err(text))

    def _answer(self, send: Callable[[zenoh.Query], None]) -> None:
        query = self._open()
        self._query = None
        try:
            send(query)
        except zenoh.ZError as error:
            raise _failure(f"the request on {self.key} cannot be answered", error) from error
        finally:
            query.drop()  # type: ignore[no-untyped-call] # tells the client that nothing more comes

    def _open(self) -> zenoh.Query:
        if self._query is None:
            raise TransportError(f"the request on {self.key} is answered already")
        return self._query


class _Querier(_Declaration):
    __slots__ = ("_key_expr",)

    def __init__(self, transport: ZenohTransport, key: str, on_matching: OnMatching | None) -> None:
        check_concrete(key)
        super().__init__(transport, key)
        querier = self.add(transport.session.declare_querier, key, target=zenoh.QueryTarget.ALL_COMPLETE)
        self._key_expr = querier.key_expr
        if on_matching is not None:
            self.watch_matching(querier, on_matching)

    def get(self, parts: Parts, attachment: bytes | None, on_reply: OnReply, timeout_ns: int) -> None:
        self.check_open()
        handler = direct(partial(self._take, on_reply), partial(self.call, on_reply, None))
        try:
            # A Zenoh querier has one timeout for all; a get of the session has its own and costs the same.
            self._transport.session.get(
                self._key_expr,
                handler,
                target=zenoh.QueryTarget.ALL_COMPLETE,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=timeout_ns / 1e9,
                payload=self._transport.frames.join(parts),
                attachment=attachment,
            )
        except zenoh.ZError as error:
            raise _failure(f"a request on {self.key} cannot be sent", error) from error

    def _take(self, on_reply: OnReply, reply: zenoh.Reply) -> None:
        if (sample := reply.ok) is not None:
            payload = memoryview(sample.payload.to_bytes())
            self.call(on_reply, Reply(payload, _bytes(sample.attachment), None))
        elif (error := reply.err) is not None and not _is_timeout(reply, error):
            text = error.payload.to_bytes().decode(errors="replace")
            self.call(on_reply, Reply(None, None, text))


def _bytes(value: zenoh.ZBytes | None) -> bytes | None:
    return None if value is None else value.to_bytes()


def _is_timeout(reply: zenoh.Reply, error: zenoh.ReplyError) -> bool:
    """Whether Zenoh itself answers that time is up: no queryable (they count from 1) is the replier."""
    replier = reply.replier_id
    return (replier is None or replier.eid == 0) and error.payload.to_bytes() == b"Timeout"


def _failure(what: str, error: zenoh.ZError) -> TransportError:
    return TransportError(f"{what}: {_reason(error)}")


def _reason(error: zenoh.ZError) -> str:
    """Return what Zenoh says without the places in its source."""
    return re.sub(r"\.? at /[^\s\]]+", "", str(error)).rstrip(".")
