"""Number sorting: a service."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.applications.roundtrip.inputs import NUMBERS
from reconros_zenoh.applications.roundtrip.kernels.sort import sort
from reconros_zenoh.errors import BadMessageError

if TYPE_CHECKING:
    from collections.abc import Generator

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.ros.types import MessageType


class Sort:
    """Serves sorter_msgs/srv/Sort: 2048 numbers of 32 bits."""

    def __init__(self, response: MessageType) -> None:
        self._response = response.cls

    def check(self, request: Any) -> None:
        """Raise BadMessageError for another number of numbers: the comparator network has a fixed size."""
        if len(request.unsorted) != NUMBERS:
            raise BadMessageError(
                "number_count", f"{len(request.unsorted)} numbers were sent, the sorter takes {NUMBERS}"
            )

    def software(self, request: Any, context: SoftwareContext) -> Any:
        """Return the response."""
        return self._response(sorted=context.compute(sort, request.unsorted))

    def hardware(self, thread: HardwareThread) -> Generator[Awaitable, object, Any]:
        """Return the response."""
        request = yield from thread.get_init_data()
        ram = yield from thread.mem_read(request.unsorted)
        numbers = yield from thread.compute(sort, ram)
        yield from thread.mem_write(numbers)
        return self._response(sorted=numbers)
