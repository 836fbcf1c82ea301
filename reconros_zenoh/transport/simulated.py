"""A network without Zenoh: messages are events of the environment.

What a link costs is not here: the board's communication stack charges it.
"""

from __future__ import annotations

from collections import deque
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from reconros_zenoh.errors import TransportError
from reconros_zenoh.ros.qos import Durability
from reconros_zenoh.transport.base import Reply, Sample
from reconros_zenoh.transport.changes import MatchingChanges
from reconros_zenoh.transport.guard import Closing, GuardedDeclaration
from reconros_zenoh.transport.key_expressions import check_concrete, check_key, intersects

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.ros.qos import QosProfile
    from reconros_zenoh.transport.base import OnMatching, OnReply, Parts, Request


class SimulatedNetwork:
    """Carries messages between its transports in no time, as events of `environment`; deterministic.

    It belongs to the thread of the environment; only the replies of a `Request` may come from another one.
    """

    def __init__(self, environment: VirtualEnvironment) -> None:
        self.environment = environment
        # Dictionaries serve as sets that keep the order in which things were declared.
        self.topics: _Ends[_Publisher] = _Ends()
        self.services: _Ends[_Querier] = _Ends()
        self.tokens: dict[_Token, None] = {}
        self.watches: dict[_Watch, None] = {}

    def transport(self, session_id: str) -> SimulatedTransport:
        """Return a new session of this network; `session_id` is lower case hexadecimal, as of Zenoh."""
        return SimulatedTransport(self, session_id)


class SimulatedTransport(Closing):
    """A `Transport` in a `SimulatedNetwork`. Sinks are called by the event loop, never from within `put`.

    A payload of one part is handed over by reference.
    """

    def __init__(self, network: SimulatedNetwork, session_id: str) -> None:
        self.session_id = session_id
        self._network = network
        self._declarations: dict[_Declaration, None] = {}
        self._closed = False

    def publish(self, key: str, qos: QosProfile, on_matching: OnMatching | None = None) -> _Publisher:
        """Declare a publisher, see `Transport.publish`."""
        check_concrete(key)
        return _Publisher(self._enter(key), key, qos, on_matching)

    def subscribe(
        self,
        key: str,
        sink: Callable[[Sample], None],
        qos: QosProfile,
        usual_key: str | None = None,  # noqa: ARG002 # all keys cost the same
    ) -> _Receiver:
        """Declare a subscription, see `Transport.subscribe`."""
        subscription = _Receiver(self._enter(key), key, self._network.topics, sink)
        if qos.durability is Durability.TRANSIENT_LOCAL:
            for publisher in subscription.senders():
                for sample in list(publisher.cache)[-qos.depth :]:
                    subscription.post(sink, sample)
        return subscription

    def serve(self, key: str, sink: Callable[[Request], None], *, complete: bool = True) -> _Receiver:
        """Declare a server, see `Transport.serve`."""
        # Whoever asks here asks complete servers only.
        ends: _Ends[_Querier] = self._network.services if complete else _Ends()
        return _Receiver(self._enter(key), key, ends, sink)

    def request(self, key: str, on_matching: OnMatching | None = None) -> _Querier:
        """Declare a querier, see `Transport.request`."""
        check_concrete(key)
        return _Querier(self._enter(key), key, self._network.services, on_matching)

    def declare_token(self, key: str) -> _Token:
        """Declare a liveliness token."""
        return _Token(self._enter(key), key)

    def tokens(self, key: str, timeout_ns: int) -> list[str]:  # noqa: ARG002 # they are known at once
        """Return the keys of the live tokens that match `key`, without waiting."""
        tokens = self._enter(key)[0].tokens
        return list(dict.fromkeys(token.key for token in tokens if intersects(key, token.key)))

    def watch_tokens(self, key: str, on_change: Callable[[str, bool], None]) -> _Watch:
        """Report tokens, see `Transport.watch_tokens`."""
        return _Watch(self._enter(key), key, on_change)

    def close(self) -> None:
        """Close every declaration. Idempotent."""
        self._closed = True
        for declaration in tuple(self._declarations):
            declaration.close()

    def _enter(self, key: str) -> _Home:
        check_key(key)
        if self._closed:
            raise TransportError(f"the transport is closed: {key} cannot be declared")
        return self._network, self._declarations


_Home = tuple[SimulatedNetwork, "dict[_Declaration, None]"]
_S = TypeVar("_S", bound="_Sender")


class _Declaration(GuardedDeclaration):
    """Stands in the tables of its network and of its transport until it is closed."""

    __slots__ = ("_mine", "network")

    def __init__(self, home: _Home, key: str) -> None:
        super().__init__(key)
        self.network, self._mine = home
        self._mine[self] = None

    def withdraw(self) -> None:
        del self._mine[self]

    def post(self, callback: Callable[..., None], *arguments: object) -> None:
        """Have `callback` called as an event of the present time, guarded."""
        self.network.environment.post(self.call, callback, *arguments)


class _Ends(Generic[_S]):
    """Publishers and subscriptions, or queriers and servers, in the order in which they were declared."""

    def __init__(self) -> None:
        self.senders: dict[_S, None] = {}
        self.receivers: dict[_Receiver, None] = {}


class _Sender(_Declaration):
    """A publisher or querier: knows its receivers, and tells when it gets its first and loses its last."""

    __slots__ = ("_ends", "_matching", "_route")

    def __init__(self, home: _Home, key: str, ends: _Ends[Any], on_matching: OnMatching | None) -> None:
        super().__init__(home, key)
        self._ends = ends
        self._matching = MatchingChanges(partial(self.post, on_matching) if on_matching else lambda _: None)
        self._route: tuple[_Receiver, ...] = ()
        ends.senders[self] = None
        self.find_route()

    def find_route(self) -> None:
        """Know the present receivers of this key."""
        self._route = tuple(each for each in self._ends.receivers if intersects(each.key, self.key))
        self._matching.report(bool(self._route))

    def withdraw(self) -> None:
        super().withdraw()
        del self._ends.senders[self]


class _Receiver(_Declaration):
    """A subscription or server; what is sent to it is posted to `sink`."""

    __slots__ = ("_ends", "sink")

    def __init__(self, home: _Home, key: str, ends: _Ends[Any], sink: Callable[[Any], None]) -> None:
        super().__init__(home, key)
        self.sink = sink
        self._ends = ends
        ends.receivers[self] = None
        self._tell_senders()

    def senders(self) -> list[Any]:
        """Return those who send on a key of this one."""
        return [each for each in self._ends.senders if intersects(each.key, self.key)]

    def _tell_senders(self) -> None:
        for sender in self.senders():
            sender.find_route()

    def withdraw(self) -> None:
        super().withdraw()
        del self._ends.receivers[self]
        self._tell_senders()


class _Publisher(_Sender):
    __slots__ = ("cache",)

    def __init__(self, home: _Home, key: str, qos: QosProfile, on_matching: OnMatching | None) -> None:
        super().__init__(home, key, home[0].topics, on_matching)
        transient = qos.durability is Durability.TRANSIENT_LOCAL
        self.cache: deque[Sample] = deque(maxlen=qos.depth if transient else 0)

    def put(self, parts: Parts, attachment: bytes | None) -> None:
        self.check_open()
        if not self._route and not self.cache.maxlen:
            return
        sample = Sample(self.key, attachment, _payload(parts))
        self.cache.append(sample)
        for subscription in self._route:
            subscription.post(subscription.sink, sample)


class _Exchange:
    """A request on its way: counts the servers that have not let go of it."""

    __slots__ = ("_on_reply", "_over", "_querier", "_waiting")

    def __init__(self, querier: _Querier, on_reply: OnReply, servers: int) -> None:
        self._querier = querier
        self._on_reply = on_reply
        self._waiting = servers
        self._over = False

    def post_answer(self, reply: Reply | None) -> None:
        """Have the event loop take the answer of one server; None if it gives none. From any thread."""
        self._querier.network.environment.post(self._answer, reply)

    def finish(self) -> None:
        """Tell the client that nothing more comes."""
        if not self._over:
            self._over = True
            self._querier.call(self._on_reply, None)

    def _answer(self, reply: Reply | None) -> None:
        if reply is not None and not self._over:
            self._querier.call(self._on_reply, reply)
        self._waiting -= 1
        if self._waiting <= 0:
            self.finish()


class _Request:
    """A request at one server; when it is forgotten unanswered the client learns that nothing comes."""

    __slots__ = ("_exchange", "_parts", "attachment", "key")

    def __init__(self, key: str, attachment: bytes | None, parts: Parts, exchange: _Exchange) -> None:
        self.key = key
        self.attachment = attachment
        self._parts = parts
        self._exchange: _Exchange | None = exchange

    def read(self) -> memoryview:
        return _payload(self._parts)

    def reply(self, parts: Parts, attachment: bytes | None) -> None:
        self._take().post_answer(Reply(_payload(parts), attachment, None))

    def reply_error(self, text: str) -> None:
        self._take().post_answer(Reply(None, None, text))

    def _take(self) -> _Exchange:
        exchange, self._exchange = self._exchange, None
        if exchange is None:
            raise TransportError(f"the request on {self.key} is answered already")
        return exchange

    def __del__(self) -> None:
        if self._exchange is not None:
            self._exchange.post_answer(None)


class _Querier(_Sender):
    __slots__ = ()

    def get(self, parts: Parts, attachment: bytes | None, on_reply: OnReply, timeout_ns: int) -> None:
        self.check_open()
        exchange = _Exchange(self, on_reply, len(self._route))
        for server in self._route:
            server.post(server.sink, _Request(self.key, attachment, parts, exchange))
        # Without a server it is over at once, but never from within this call.
        self.network.environment.call_later(timeout_ns if self._route else 0, exchange.finish)


class _Token(_Declaration):
    """A liveliness token; tokens of one key count as one."""

    __slots__ = ()

    def __init__(self, home: _Home, key: str) -> None:
        super().__init__(home, key)
        self._tell_watches(alive=True)
        self.network.tokens[self] = None

    def _tell_watches(self, *, alive: bool) -> None:
        if all(token.key != self.key for token in self.network.tokens):
            for watch in self.network.watches:
                watch.report((self.key,), alive=alive)

    def withdraw(self) -> None:
        super().withdraw()
        del self.network.tokens[self]
        self._tell_watches(alive=False)


class _Watch(_Declaration):
    __slots__ = ("_on_change",)

    def __init__(self, home: _Home, key: str, on_change: Callable[[str, bool], None]) -> None:
        super().__init__(home, key)
        self._on_change = on_change
        self.report(dict.fromkeys(token.key for token in self.network.tokens), alive=True)
        self.network.watches[self] = None

    def report(self, tokens: Iterable[str], *, alive: bool) -> None:
        """Report those of `tokens` that match."""
        for token in tokens:
            if intersects(self.key, token):
                self.post(self._on_change, token, alive)

    def withdraw(self) -> None:
        super().withdraw()
        del self.network.watches[self]


def _payload(parts: Parts) -> memoryview:
    return memoryview(parts[0] if len(parts) == 1 else b"".join(parts)).toreadonly()
