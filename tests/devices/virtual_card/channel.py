"""Two ways to the servicer: straight through real protobuf messages, and over TCP."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import grpc
from nidaqmx._stubs.nidaqmx_pb2_grpc import add_NiDAQmxServicer_to_server

from .servicer import Servicer


class CallFailed(grpc.RpcError):
    """What a client sees of a call that failed."""

    def __init__(self, code: grpc.StatusCode, details: str, trailing: tuple[Any, ...] = ()) -> None:
        super().__init__(details)
        self._code, self._details, self._trailing = code, details, trailing

    def code(self) -> grpc.StatusCode:
        return self._code

    def details(self) -> str:
        return self._details

    def trailing_metadata(self) -> tuple[Any, ...]:
        return self._trailing


class _Entry:
    def __init__(self, key: str, value: str) -> None:
        self.key, self.value = key, value


class _Context:
    def __init__(self) -> None:
        self._trailing: tuple[Any, ...] = ()

    def set_trailing_metadata(self, pairs: Any) -> None:
        self._trailing = tuple(_Entry(key, value) for key, value in pairs)

    def abort(self, code: grpc.StatusCode, details: str) -> None:
        raise CallFailed(code, details, self._trailing)

    def set_code(self, code: grpc.StatusCode) -> None:
        self._code = code

    def set_details(self, details: str) -> None:
        raise CallFailed(self._code, details)


class InProcessChannel:
    """A channel without a network: serialises, calls, deserialises. ``lost`` makes it a dead server."""

    def __init__(self, servicer: Servicer) -> None:
        self._handlers: dict[str, Any] = {}
        self.servicer = servicer
        self.lost: grpc.StatusCode | None = None
        add_NiDAQmxServicer_to_server(servicer, self)

    def add_generic_rpc_handlers(self, handlers: Any) -> None:
        for handler in handlers:
            self._handlers.update(handler._method_handlers)

    def add_registered_method_handlers(self, service: str, handlers: Any) -> None:
        """Newer stubs register a second time; the generic handlers are enough."""

    def unary_unary(self, method: str, request_serializer: Any, response_deserializer: Any, **_: Any) -> Any:
        handler = self._handlers[method]

        def call(request: Any, timeout: float | None = None, metadata: Any = None) -> Any:
            if self.lost is not None:
                raise CallFailed(self.lost, "the server is gone")
            received = handler.request_deserializer(request_serializer(request))
            answer = handler.unary_unary(received, _Context())
            return response_deserializer(handler.response_serializer(answer))

        return call

    def unary_stream(self, *_: Any, **__: Any) -> Any:
        """Events are not used."""
        return None


class TcpServer:
    """The servicer behind a real port of this machine; with ``workers`` it takes so many calls at a time."""

    def __init__(self, servicer: Servicer, workers: int = 1) -> None:
        self._server = grpc.server(ThreadPoolExecutor(max_workers=workers))
        add_NiDAQmxServicer_to_server(servicer, self._server)
        self.address = f"127.0.0.1:{self._server.add_insecure_port('127.0.0.1:0')}"
        self._server.start()

    def stop(self) -> None:
        self._server.stop(grace=None).wait(5.0)
