"""An endpoint on loopback that speaks OpenAI's chat protocol and says what a test tells it to."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

Reply = Callable[[dict[str, Any]], "Said"]


@dataclass
class Said:
    """What the endpoint answers."""

    body: bytes
    status: int = 200
    wait: float = 0.0
    promised: int = 0  # bytes more than come
    trickle: float = 0.0  # wait after each byte
    headers: dict[str, str] = field(default_factory=lambda: {"retry-after-ms": "1"})


@dataclass
class Endpoint:
    """What was asked, and where."""

    url: str
    asked: list[dict[str, Any]] = field(default_factory=list)


def message(content: str | None, **more: Any) -> Said:
    """Return a chat completion of 100 tokens asked and 20 said."""
    choice = {"index": 0, "finish_reason": "stop", "message": {"role": "assistant", "content": content, **more}}
    usage = {"prompt_tokens": 100, "completion_tokens": 20, "total_tokens": 120}
    body = {"id": "1", "object": "chat.completion", "created": 0, "model": "fake", "choices": [choice], "usage": usage}
    return Said(json.dumps(body).encode())


def failure(status: int, words: str) -> Said:
    return Said(json.dumps({"error": {"message": words, "type": "test"}}).encode(), status)


@contextmanager
def endpoint(*replies: Reply | Said) -> Iterator[Endpoint]:
    """Answer the first request with the first reply, and so on; the last one also answers what comes after."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            found.asked.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            reply = replies[min(len(found.asked), len(replies)) - 1]
            said = reply(found.asked[-1]) if callable(reply) else reply
            time.sleep(said.wait)
            try:
                self.send_response(said.status)
                self.send_header("Content-Length", str(len(said.body) + said.promised))
                for name, value in {"Content-Type": "application/json", **said.headers}.items():
                    self.send_header(name, value)
                self.end_headers()
                for piece in [said.body[i : i + 1] for i in range(len(said.body))] if said.trickle else [said.body]:
                    self.wfile.write(piece)
                    time.sleep(said.trickle)
                self.close_connection = True
            except (BrokenPipeError, ConnectionResetError):
                pass  # the client has heard enough

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    found = Endpoint(f"http://127.0.0.1:{server.server_port}/v1")
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
    try:
        yield found
    finally:
        server.shutdown()
        server.server_close()
