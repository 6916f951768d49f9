"""What the tests share: a real service, a proxy that breaks connections, a server that says what it is told to."""
from __future__ import annotations

import contextlib
import http.server
import os
import pathlib
import re
import shutil
import socket
import subprocess
import tempfile
import threading
import time
import unittest

GONIO = os.environ["GONIO"]
ROOT = pathlib.Path(__file__).resolve().parents[2]

MATERIAL = {"model": "lambertian", "albedo": 0.5}
MEASURE = {"kind": "brdf", "incident": {"theta_deg": [0], "phi_deg": [0]},
           "outgoing": {"theta_deg": [0, 30, 60], "phi_deg": [0]}}
SURFACE = {"generate": "v_groove", "samples": 16, "period": "1 mm", "slope_deg": 45}
JOB = {"surface": SURFACE, "material": MATERIAL, "measure": MEASURE}
# Minutes of work, in many short runs: it reports progress, and ends soon when it is told to.
LONG = JOB | {"surface": {"generate": "gaussian", "samples": 24, "pitch": "1 um", "correlation_length": "3 um",
                          "rms_slope": 1},
              "accuracy": {"samples": {"replicates": 4096}}}
# Some seconds of the same.
MEDIUM = LONG | {"accuracy": {"samples": {"replicates": 60}}}
# The table has some 100 kB.
LARGE = JOB | {"measure": MEASURE | {"incident": {"hemisphere": 40}, "outgoing": {"hemisphere": 40}},
               "accuracy": {"samples": {}}}


class Service:
    """`gonio serve` on a folder of its own."""

    def __init__(self, *options: str) -> None:
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio_python_"))
        self.options = options
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen([GONIO, "serve", "--data", str(self.folder / "data"), "--listen", "127.0.0.1:0",
                                         "--threads", "1", *self.options], stdout=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        found = re.fullmatch(r"listening on (http://127\.0\.0\.1:(\d+))\n", line)
        if not found:
            self.stop()
            raise RuntimeError(f"gonio serve said {line!r}")
        self.url, self.port = found[1], int(found[2])

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def stop(self) -> None:
        self.kill()
        shutil.rmtree(self.folder)


class ServiceTest(unittest.TestCase):
    """A test with one service for all of its methods, and a temporary folder for each."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.service = Service()
        cls.addClassCleanup(cls.service.stop)

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory(prefix="gonio_python_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def proxy(self) -> Proxy:
        proxy = Proxy(self.service.port)
        self.addCleanup(proxy.close)
        return proxy


class Proxy:
    """Passes connections on, each of one request, and harms their answers.

    harm(request line, body of the answer so far) -> what to pass on of the answer: shorter than it came: the connection
    is cut there. None passes everything. Records the heads of the requests.
    """

    def __init__(self, port: int) -> None:
        self.port = port
        self.harm = None
        self.requests: list[str] = []
        self.refused = 0
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        self.thread = threading.Thread(target=self._accept, daemon=True)
        self.thread.start()

    def close(self) -> None:
        self.listener.shutdown(socket.SHUT_RDWR)
        self.thread.join()
        self.listener.close()

    def count(self, start: str) -> int:
        return sum(head.startswith(start) for head in self.requests)

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with client:
            try:
                server = socket.create_connection(("127.0.0.1", self.port))
            except OSError:
                self.refused += 1
                return
            with server:
                head = b""
                while b"\r\n\r\n" not in head and (block := client.recv(65536)):
                    head += block
                self.requests.append(head.partition(b"\r\n\r\n")[0].decode())
                server.sendall(head)
                threading.Thread(target=_pump, args=(client, server), daemon=True).start()
                with contextlib.suppress(OSError):
                    self._answer(server, client, self.requests[-1].split("\r\n")[0])
                # Not by close() alone: the other thread still reads from these.
                for connection in (client, server):
                    with contextlib.suppress(OSError):
                        connection.shutdown(socket.SHUT_RDWR)

    def _answer(self, server: socket.socket, client: socket.socket, line: str) -> None:
        if self.harm is None:
            _pump(server, client)
            return
        answer, sent = b"", 0
        while block := server.recv(65536):
            answer += block
            head, _, body = answer.partition(b"\r\n\r\n")
            if len(answer) == len(head):
                continue
            passed = self.harm(line, body)
            if passed is None:
                passed = body
            whole = head + b"\r\n\r\n" + passed
            client.sendall(whole[sent:] if passed or not body else b"")
            sent = len(whole)
            if len(passed) < len(body):
                return


def _pump(source: socket.socket, sink: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while block := source.recv(65536):
            sink.sendall(block)
        sink.shutdown(socket.SHUT_WR)


class Script(http.server.ThreadingHTTPServer):
    """A server whose answers are the next of a list: (status, headers, body), or raw bytes. Records the requests
    (method and path, headers) and their bodies. An answer of None closes the connection without one."""

    def __init__(self, *answers: tuple[int, dict[str, str], bytes] | bytes | None) -> None:
        super().__init__(("127.0.0.1", 0), _ScriptHandler)
        self.answers = list(answers)
        self.requests: list[tuple[str, dict[str, str]]] = []
        self.bodies: list[bytes] = []
        self.url = f"http://127.0.0.1:{self.server_address[1]}"
        self.thread = threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.01})
        self.thread.start()

    def close(self) -> None:
        self.shutdown()
        self.thread.join()
        self.server_close()


class _ScriptHandler(http.server.BaseHTTPRequestHandler):
    def answer(self) -> None:
        self.server.bodies.append(self.rfile.read(int(self.headers.get("Content-Length", 0))))
        self.server.requests.append((f"{self.command} {self.path}", dict(self.headers)))
        answer = self.server.answers.pop(0)
        self.close_connection = True
        if answer is None:
            return
        if isinstance(answer, bytes):
            self.wfile.write(answer)
            return
        status, headers, body = answer
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    do_GET = do_POST = do_PUT = do_HEAD = do_DELETE = answer

    def log_message(self, *_: object) -> None:
        pass


class Clock:
    """Time that passes only while somebody sleeps."""

    def __init__(self) -> None:
        self.now = 1000.0
        self.slept: list[float] = []

    def monotonic(self) -> float:
        return self.now

    def time(self) -> float:
        return time.time()

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += seconds


def until(condition) -> None:
    """Returns once the condition holds; a test that hangs here is ended by its runner."""
    while not condition():
        time.sleep(0.01)
