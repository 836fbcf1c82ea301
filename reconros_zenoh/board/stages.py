"""The stages of the way of a message, of which its end-to-end time is the sum."""

from typing import Literal

Stage = Literal[
    "transport",  # on the network, with the desktop's share
    "dds",  # in the communication stack, waiting for cores included
    "retransmission",  # lost and sent again
    "queue",  # ready, until a worker took it
    "dispatch",  # from being taken to being started
    "reconfiguration",  # until the slot held its bitstream, waiting for the ICAP included
    "execution",  # computing
    "memif",  # memory transfers of a slot
    "blocked",  # waiting for a mailbox, mutex, condition or semaphore
    "hmt",  # on the stream of a hardware-mapped topic, waiting for room included
    "gateway",  # in a gateway core: waiting for it, and until its request is cancelled
    "osif",  # calls of a slot through its delegate thread
    "overrun",  # the host was slower than the modelled time
]
