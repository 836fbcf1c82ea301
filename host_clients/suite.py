"""The five clients by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from host_clients.hash import HashExchange
from host_clients.inverse import InverseExchange
from host_clients.mnist import MnistExchange
from host_clients.sobel import SobelExchange
from host_clients.sort import SortExchange

if TYPE_CHECKING:
    from host_clients.exchange import Exchange

EXCHANGES = {
    kind.name: kind for kind in (InverseExchange, MnistExchange, SobelExchange, SortExchange, HashExchange)
}


def exchange(name: str, seed: int) -> Exchange:
    """Return what the client of that name asks; the inputs follow from the seed."""
    return EXCHANGES[name](np.random.default_rng([seed, list(EXCHANGES).index(name)]))
