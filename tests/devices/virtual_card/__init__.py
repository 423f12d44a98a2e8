"""A PCIe-6343 that is not there: answers the device server's calls, on a clock that counts samples.

The real ``nidaqmx`` package speaks to it through real protobuf messages. It is written from the driver's
manual and from what the package was seen to ask, not from the project's own driver code.
"""

from .card import Card, DaqFailure, SimplePlant
from .channel import InProcessChannel, TcpServer
from .servicer import Servicer

__all__ = ["Card", "DaqFailure", "InProcessChannel", "Servicer", "SimplePlant", "TcpServer"]
