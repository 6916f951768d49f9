#!/usr/bin/env python3
"""Attacks on the HTTP layer. Each runs against the plain library, where it must succeed (or the test could not
fail), and against ours, which must stand. Then what ours answers where nobody attacks.

Usage: http_attacks_test.py HTTP_TEST_SERVER [unittest options]
"""
import base64
import gzip
import hashlib
import json
import os
import pathlib
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = os.path.abspath(sys.argv.pop(1))
MB = 1 << 20
BLOB = 32 * MB  # as in http_test_server.cpp
FOLDER = pathlib.Path(tempfile.mkdtemp(prefix="gonio_http_"))
CLOSE = b"Connection: close\r\n\r\n"
WRITTEN = []  # (attack, what the naive server did, what ours did)


class Server:
    def __init__(self, kind, port=0):
        self.process = subprocess.Popen([PROGRAM, kind, str(port), str(FOLDER)], stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE)
        line = self.process.stdout.readline()
        self.started = bool(line)
        self.port = int(line) if line else 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()
        self.process.stderr.close()

    def connect(self, timeout=8):
        client = socket.create_connection(("127.0.0.1", self.port), timeout=timeout)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return client

    def peak_mb(self):
        for line in pathlib.Path(f"/proc/{self.process.pid}/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
        return 0

    def send(self, *pieces, pause=0.0, timeout=8):
        """Sends the pieces one after the other; everything that comes back until the server closes."""
        with self.connect(timeout) as client:
            try:
                for i, piece in enumerate(pieces):
                    if i and pause:
                        time.sleep(pause)
                    client.sendall(piece)
            except OSError:
                pass  # the answer may be there all the same
            return receive_all(client)

    def get(self, path, *headers, method="GET"):
        lines = [f"{method} {path} HTTP/1.1", "Host: x", *headers]
        return Answer(self.send("\r\n".join(lines).encode() + b"\r\n" + CLOSE))

    def post(self, path, body, *headers):
        lines = [f"POST {path} HTTP/1.1", "Host: x", f"Content-Length: {len(body)}", *headers]
        return Answer(self.send("\r\n".join(lines).encode() + b"\r\n" + CLOSE + body))


def receive_all(client, most=400 * MB):
    pieces, total = [], 0
    try:
        while total < most:
            piece = client.recv(1 << 16)
            if not piece:
                break
            pieces.append(piece)
            total += len(piece)
    except OSError:
        pass
    return b"".join(pieces)


class Answer:
    """The first response of what came back."""

    def __init__(self, raw):
        self.raw = raw
        head, _, self.body = raw.partition(b"\r\n\r\n")
        lines = head.decode("latin-1").split("\r\n")
        self.status = int(lines[0].split()[1]) if raw.startswith(b"HTTP/1.1 ") else 0
        self.headers = {line.partition(": ")[0].lower(): line.partition(": ")[2] for line in lines[1:]}

    def problem(self):
        assert self.headers["content-type"] == "application/problem+json", self.raw[:300]
        document = json.loads(self.body)
        assert document["status"] == self.status and document["title"] and document["type"], document
        return document


# Attacks: each returns whether the server stood, and what was seen.

def chunked_body_beyond_the_limit(server):
    before = server.peak_mb()
    chunk = b"100000\r\n" + b"x" * MB + b"\r\n"
    answer = Answer(server.send(b"POST /upload HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n" + CLOSE,
                                *[chunk] * 40, b"0\r\n\r\n"))
    grown = server.peak_mb() - before
    return answer.status == 413 and grown < 10, f"limit 1 MB, 40 MB sent: {answer.status}, +{grown:.0f} MB"


def chunked_body_to_an_unknown_path(server):
    before = server.peak_mb()
    chunk = b"100000\r\n" + b"x" * MB + b"\r\n"
    answer = Answer(server.send(b"POST /nowhere HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n" + CLOSE,
                                *[chunk] * 40, b"0\r\n\r\n"))
    grown = server.peak_mb() - before
    return answer.status == 404 and grown < 10, f"{answer.status}, +{grown:.0f} MB"


def announced_body_beyond_the_limit(server):
    with server.connect(timeout=1) as client:
        client.sendall(b"POST /upload HTTP/1.1\r\nHost: x\r\nContent-Length: 200000000\r\n" + CLOSE)
        answer = Answer(receive_all(client))
    return answer.status == 413, f"refused before the upload: {answer.status == 413}"


def endless_header_line(server):
    before = server.peak_mb()
    answer = Answer(server.send(b"GET /small HTTP/1.1\r\nHost: x\r\nX: ", *[b"a" * MB] * 16, b"\r\n" + CLOSE))
    grown = server.peak_mb() - before
    return answer.status == 431 and grown < 10, f"{answer.status or 'none'}, +{grown:.0f} MB"


def hundred_thousand_headers(server):
    lines = b"".join(b"A%d: b\r\n" % i for i in range(100000))
    answer = Answer(server.send(b"GET /small HTTP/1.1\r\nHost: x\r\n", lines, CLOSE))
    return answer.status == 431, str(answer.status)


def gzip_bomb(server):
    before = server.peak_mb()
    answer = server.post("/upload", gzip.compress(bytes(60 * MB)), "Content-Encoding: gzip")
    grown = server.peak_mb() - before
    return answer.status == 415 and grown < 10, f"60 KB of gzip: {answer.status}, +{grown:.0f} MB"


def exception_text(server):
    answer = server.get("/throw")
    return answer.status == 500 and b"secret" not in answer.raw, f"text sent: {b'secret' in answer.raw}"


def negative_chunk_size(server):
    start = time.monotonic()
    answer = Answer(server.send(b"POST /upload HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n-2\r\n"
                                + b"A" * 1000, timeout=2))
    seconds = time.monotonic() - start
    return answer.status == 400 and seconds < 1.5, f"{answer.status or 'no answer'} in {seconds:.1f} s"


def percent_decoded_header(server):
    answer = server.get("/header", "X-A: a%0d%0ab")
    return b"0d0a" not in answer.body, f"handler sees {bytes.fromhex(answer.body.decode())}"


def client_sent_remote_addr(server):
    answer = server.get("/address", "REMOTE_ADDR: 6.6.6.6")
    return answer.body == b"127.0.0.1", f"handler sees {answer.body.decode()}"


def range_beyond_the_end(server):
    answer = server.get("/blob", f"Range: bytes={BLOB - 100}-{BLOB + 9400}")
    return answer.status == 206 and answer.body == b"b" * 100, f"{answer.status}, {len(answer.body)} bytes of 100"


def many_ranges(server):
    answer = server.get("/text", "Range: bytes=" + ",".join(["0-"] * 100))
    return len(answer.raw) < 2 * MB, f"1 MB text: {len(answer.raw) / MB:.0f} MB sent"


def pipelining(server):
    one = b"GET /small HTTP/1.1\r\nHost: x\r\n"
    raw = server.send(one + b"\r\n" + one + CLOSE, timeout=2)
    return raw.count(b"HTTP/1.1 200") == 2, f"{raw.count(b'HTTP/1.1 200')} of 2 answered"


def keep_alive_latency(server):
    request = b"GET /small HTTP/1.1\r\nHost: x\r\n\r\n"
    times = []
    with server.connect() as client:
        for _ in range(4):
            start, raw = time.monotonic(), b""
            client.sendall(request)
            while not raw.endswith(b"ok"):
                piece = client.recv(4096)
                if not piece:
                    break
                raw += piece
            times.append(time.monotonic() - start)
    middle = sorted(times)[1] * 1e3
    return middle < 20, f"{middle:.1f} ms"


def probe_seconds(server, give_up):
    start = time.monotonic()
    try:
        with server.connect(timeout=give_up) as client:
            client.sendall(b"GET /small HTTP/1.1\r\nHost: x\r\n" + CLOSE)
            return time.monotonic() - start if client.recv(100) else give_up
    except OSError:
        return give_up


def idle_connections(server):
    clients = [server.connect() for _ in range(8)]
    time.sleep(0.2)
    seconds = probe_seconds(server, 2)
    for client in clients:
        client.close()
    return seconds < 1, f"8 of them: answered after {seconds:.1f} s"


def idle_after_a_request(server):
    clients = [server.connect() for _ in range(8)]
    for client in clients:
        client.sendall(b"GET /small HTTP/1.1\r\nHost: x\r\n\r\n")
        client.recv(4096)
    seconds = probe_seconds(server, 2)
    for client in clients:
        client.close()
    return seconds < 1, f"8 of them: answered after {seconds:.1f} s"


def dripping(server, first, drop):
    """Eight clients (as many as threads) send one byte every 50 ms; how long does a ninth wait?"""
    clients = [server.connect() for _ in range(8)]
    for client in clients:
        client.sendall(first)
    time.sleep(0.2)
    with server.connect(timeout=8) as probe:
        start = time.monotonic()
        probe.sendall(b"GET /small HTTP/1.1\r\nHost: x\r\n" + CLOSE)
        probe.setblocking(False)
        seconds = None
        while seconds is None and time.monotonic() - start < 3:
            for client in clients:
                try:
                    client.send(drop)
                except OSError:
                    pass
            time.sleep(0.05)
            try:
                if probe.recv(100):
                    seconds = time.monotonic() - start
            except BlockingIOError:
                pass
    for client in clients:
        client.close()
    return seconds is not None, f"ninth client: {'no answer in 3 s' if seconds is None else f'{seconds:.1f} s'}"


def dripping_headers(server):
    return dripping(server, b"GET /small HTTP/1.1\r\nHost: x\r\nX: ", b"a")


def dripping_bodies(server):
    return dripping(server, b"POST /upload HTTP/1.1\r\nHost: x\r\nContent-Length: 100000\r\n\r\n", b"a")


def burst_of_connects(server):
    server.process.send_signal(signal.SIGSTOP)  # so that only the backlog counts
    clients = []
    for _ in range(60):
        client = socket.socket()
        client.setblocking(False)
        client.connect_ex(("127.0.0.1", server.port))
        clients.append(client)
    time.sleep(0.3)
    connected = 0
    for client in clients:
        try:
            client.getpeername()
            connected += 1
        except OSError:
            pass
        client.close()
    server.process.send_signal(signal.SIGCONT)
    return connected == 60, f"{connected} of 60 connected at once"


def second_server_on_the_port(server):
    kind = server.process.args[1]
    with Server(kind, server.port) as second:
        return not second.started, f"second one started: {second.started}"


def download_during_sigterm(server):
    with server.connect() as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
        client.sendall(b"GET /blob HTTP/1.1\r\nHost: x\r\n\r\n")
        raw = client.recv(4096)
        server.process.send_signal(signal.SIGTERM)
        time.sleep(0.3)
        raw += receive_all(client)
    got = len(Answer(raw).body)
    return got == BLOB, f"{got / MB:.1f} of {BLOB / MB:.0f} MB arrived"


SECOND = b"GET /secret HTTP/1.1\r\nHost: x\r\n" + CLOSE
POST = b"POST /upload HTTP/1.1\r\nHost: x\r\n"
SMUGGLED = {
    "body of a GET": b"GET /small HTTP/1.1\r\nHost: x\r\nContent-Length: %d\r\n\r\n" % len(SECOND),
    "chunked GET": b"GET /small HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n",
    "length and chunks": POST + b"Content-Length: %d\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n" % (5 + len(SECOND)),
    "two lengths": POST + b"Content-Length: 0\r\nContent-Length: %d\r\n\r\n" % len(SECOND),
    "gzip, chunked": POST + b"Transfer-Encoding: gzip, chunked\r\nContent-Length: 0\r\n\r\n",
    "list of lengths": POST + b"Content-Length: 0, %d\r\n\r\n" % len(SECOND),
}


def smuggling(first):
    def attack(server):
        raw = server.send(first, SECOND, pause=0.2, timeout=3)
        return b"SMUGGLED" not in raw, f"second request answered: {b'SMUGGLED' in raw}"
    return attack


ATTACKS = [
    chunked_body_beyond_the_limit, chunked_body_to_an_unknown_path, announced_body_beyond_the_limit,
    endless_header_line, hundred_thousand_headers, gzip_bomb, exception_text, negative_chunk_size,
    percent_decoded_header, client_sent_remote_addr, range_beyond_the_end, many_ranges, pipelining,
    keep_alive_latency, idle_connections, idle_after_a_request, dripping_headers, dripping_bodies,
    burst_of_connects, second_server_on_the_port, download_during_sigterm,
]


class Attacks(unittest.TestCase):
    def judge(self, name, attack):
        with Server("naive") as server:
            naive_stands, naive = attack(server)
        with Server("guarded") as server:
            guarded_stands, guarded = attack(server)
        WRITTEN.append((name, naive, guarded))
        self.assertTrue(guarded_stands, f"ours fell: {guarded}")
        self.assertFalse(naive_stands, f"the plain library stood, so this test cannot fail: {naive}")


def add_attack(name, attack):
    setattr(Attacks, "test_" + name.replace(" ", "_").replace(",", ""), lambda self: self.judge(name, attack))


for one in ATTACKS:
    add_attack(one.__name__.replace("_", " "), one)
for variant, opening in SMUGGLED.items():
    add_attack("smuggling: " + variant, smuggling(opening))


class Refusals(unittest.TestCase):
    """What is no attack, or fells neither server, but must be answered as a problem document."""

    @classmethod
    def setUpClass(cls):
        cls.server = Server("guarded")
        cls.addClassCleanup(cls.server.__exit__)

    def test_requests_that_are_refused(self):
        host = b"Host: x\r\n"
        for status, raw in [
            (400, b"GET /small HTTP/1.1\r\n\r\n"),
            (400, b"GET /small HTTP/1.1\r\nHost: x\r\nHost: y\r\n\r\n"),
            (400, b"GET /small HTTP/1.1\nHost: x\n\n"),
            (400, b"GET /small HTTP/1.1\r\n" + host + b"X : a\r\n\r\n"),
            (400, b"GET /small HTTP/1.1\r\n" + host + b"X: a\r\n folded\r\n\r\n"),
            (400, b"GET /small HTTP/1.1\r\n" + host + b"X: a\0b\r\n\r\n"),
            (400, b"GET /small HTTP/1.1\r\n" + host + b"X: a\rb\r\n\r\n"),
            (400, b"GET small HTTP/1.1\r\n" + host + b"\r\n"),
            (400, b"GET /small%0d%0aX HTTP/1.1\r\n" + host + CLOSE),
            (400, b"GET /small%4 HTTP/1.1\r\n" + host + CLOSE),
            (400, b"nonsense\r\n\r\n"),
            (400, POST + b"Content-Length: +5\r\n\r\nhello"),
            (400, POST + b"Content-Length: -1\r\n\r\nhello"),
            (400, POST + b"Content-Length: 99999999999999999999\r\n\r\n"),
            (400, POST + b"Transfer-Encoding: chunked\r\n\r\n5 \r\nhello\r\n0\r\n\r\n"),
            (400, POST + b"Transfer-Encoding: chunked\r\n\r\n5\r\nhelloX\r\n0\r\n\r\n"),
            (400, POST + b"Transfer-Encoding: chunked\r\n\r\nffffffffffffffffff\r\n"),
            (411, POST + b"\r\n"),
            (413, POST + b"Content-Length: 1048577\r\n\r\n"),
            (414, b"GET /" + b"a" * 9000 + b" HTTP/1.1\r\n" + host + b"\r\n"),
            (415, POST + b"Content-Encoding: br\r\nContent-Length: 1\r\n\r\nx"),
            (417, POST + b"Expect: cake\r\nContent-Length: 1\r\n\r\nx"),
            (431, b"GET /small HTTP/1.1\r\n" + host + b"A: b\r\n" * 200 + b"\r\n"),
            (501, b"BREW /small HTTP/1.1\r\n" + host + b"\r\n"),
            (501, POST + b"Transfer-Encoding: gzip\r\n\r\n"),
            (505, b"GET /small HTTP/2.0\r\n" + host + b"\r\n"),
        ]:
            with self.subTest(raw=raw[:80]):
                answer = Answer(self.server.send(raw, timeout=5))
                self.assertEqual(answer.status, status, answer.raw[:300])
                answer.problem()
                self.assertEqual(len(re.findall(rb"HTTP/1\.1 \d", answer.raw)), 1)

    def test_slow_clients_are_told(self):
        for opening in [b"GET /small HTTP/1.1\r\nHost", POST + b"Content-Length: 9\r\n\r\nhello"]:
            answer = Answer(self.server.send(opening, timeout=5))
            self.assertEqual(answer.status, 408)
            answer.problem()

    def test_routes(self):
        missing = self.server.get("/nowhere?x=1").problem()
        self.assertEqual((missing["status"], missing["instance"]), (404, "/nowhere"))
        wrong = self.server.post("/small", b"")
        self.assertEqual((wrong.status, wrong.headers["allow"]), (405, "GET, HEAD"))
        wrong.problem()
        head = self.server.get("/small", method="HEAD")
        self.assertEqual((head.status, head.headers["content-length"], head.body), (200, "2", b""))

    def test_errors_of_the_server_keep_its_secrets(self):
        for path, status in [("/throw", 500), ("/io", 503)]:
            answer = self.server.get(path)
            self.assertEqual(answer.status, status)
            answer.problem()
            self.assertNotIn(b"secret", answer.raw)
            self.assertNotIn(b"/etc", answer.raw)

    def test_a_handler_cannot_be_made_to_forge_headers(self):
        self.assertNotIn("x-forged", self.server.get("/inject").headers)

    def test_json(self):
        def refused(body, *headers):
            return self.server.post("/json", body, *(headers or ["Content-Type: application/json"]))
        self.assertEqual(refused(b'{"a": [1]}').body, b'{"a":[1]}')
        twice = refused(b'{"a": [{}, {"b": 1, "b": 2}]}').problem()
        self.assertEqual((twice["status"], twice["errors"][0]["pointer"]), (400, "/a/1/b"))
        self.assertEqual(refused(b"[" * 30000).problem()["status"], 400)
        self.assertEqual(refused(b'{"a": "\xff"}').problem()["status"], 400)
        self.assertEqual(refused(b'{"a": 1e999}').problem()["status"], 400)
        self.assertEqual(refused(b'"' + b"x" * 70000 + b'"').problem()["status"], 413)
        self.assertEqual(refused(b"{}", "Content-Type: text/plain").problem()["status"], 415)

    def test_mutated_requests_leave_it_alive(self):
        rng = random.Random(5)
        seeds = [b"GET /small HTTP/1.1\r\nHost: x\r\n\r\n", POST + b"Content-Length: 5\r\n\r\nhello",
                 POST + b"Transfer-Encoding: chunked\r\n\r\n5\r\nhello\r\n0\r\n\r\n",
                 b"GET /blob HTTP/1.1\r\nHost: x\r\nRange: bytes=0-10\r\n\r\n",
                 b"GET /choice?f=%20&x=+ HTTP/1.1\r\nHost: x\r\nAccept: a/b;q=1\r\n\r\n"]
        tokens = [b"\r\n", b"\n", b"\0", b":", b" ", b"%0d", b"-1", b"9" * 20, b"Content-Length: ", b"\xff", b"0\r\n\r\n"]
        end = time.monotonic() + 2
        while time.monotonic() < end:
            raw = bytearray(rng.choice(seeds))
            for _ in range(rng.choice([1, 1, 2, 4])):
                at, kind = rng.randrange(len(raw) + 1), rng.random()
                if kind < 0.3 and raw:
                    raw[at % len(raw)] = rng.randrange(256)
                elif kind < 0.6:
                    raw[at:at] = rng.choice(tokens)
                elif kind < 0.8:
                    del raw[at:at + rng.randrange(1, 8)]
                else:
                    raw[at:at] = raw[max(0, at - 9):at] * rng.choice([1, 3, 50])
            with self.server.connect(timeout=0.25) as client:
                try:
                    client.sendall(raw)
                    client.shutdown(socket.SHUT_WR)
                    client.recv(1 << 16)
                except OSError:
                    pass
        self.assertEqual(self.server.get("/small").body, b"ok")
        self.assertIsNone(self.server.process.poll())


class Service(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = Server("guarded")
        cls.addClassCleanup(cls.server.__exit__)

    def test_upload(self):
        body = os.urandom(MB)
        self.assertEqual(self.server.post("/upload", body).body, b"%d" % MB)
        # curl's default media type, which the plain library cuts at 8 KiB
        form = self.server.post("/upload", body, "Content-Type: application/x-www-form-urlencoded")
        self.assertEqual(form.body, b"%d" % MB)

    def test_chunks_and_the_next_request_share_a_connection(self):
        pieces = [POST + b"Transfer-Encoding: chunked\r\n\r\n", b"3;x=y\r\nab", b"c\r\n2\r", b"\nde\r\n0\r\nT: t\r\n\r", b"\n",
                  b"GET /small HTTP/1.1\r\nHost: x\r\n" + CLOSE]
        raw = self.server.send(*pieces, pause=0.02)
        self.assertEqual(raw.count(b"HTTP/1.1 200"), 2)
        self.assertIn(b"\r\n\r\n5HTTP/1.1", raw)

    def test_a_body_that_no_handler_read_ends_the_connection(self):
        raw = self.server.send(b"POST /unread HTTP/1.1\r\nHost: x\r\nContent-Length: %d\r\n\r\n" % len(SECOND), SECOND,
                               pause=0.1)
        self.assertEqual(raw.count(b"HTTP/1.1 "), 1)
        self.assertEqual(Answer(raw).headers["connection"], "close")

    def test_continue_is_sent_when_the_handler_reads(self):
        expect = b"Expect: 100-continue\r\nContent-Length: 2\r\n" + CLOSE
        with self.server.connect() as client:
            client.sendall(POST + expect)
            self.assertEqual(client.recv(100), b"HTTP/1.1 100 Continue\r\n\r\n")
            client.sendall(b"ab")
            self.assertEqual(Answer(receive_all(client)).body, b"2")
        refused = self.server.send(b"POST /nowhere HTTP/1.1\r\nHost: x\r\n" + expect)
        self.assertEqual(Answer(refused).status, 404)

    def test_http_1_0(self):
        raw = self.server.send(b"GET /small HTTP/1.0\r\n\r\n")
        self.assertTrue(raw.endswith(b"\r\n\r\nok"), raw)

    def test_files(self):
        content = b"0123456789" * 1000
        (FOLDER / "a b.csv").write_bytes(content)
        tag = '"' + hashlib.sha256(content).hexdigest() + '"'
        path = "/files/a%20b.csv"
        whole = self.server.get(path)
        self.assertEqual((whole.status, whole.body), (200, content))
        self.assertEqual(whole.headers["etag"], tag)
        digest = base64.b64encode(hashlib.sha256(content).digest()).decode()
        self.assertEqual(whole.headers["repr-digest"], f"sha-256=:{digest}:")
        self.assertIn("immutable", whole.headers["cache-control"])
        self.assertEqual(whole.headers["accept-ranges"], "bytes")
        self.assertIn('filename="a b.csv"', whole.headers["content-disposition"])
        head = self.server.get(path, method="HEAD")
        self.assertEqual((head.status, head.headers["content-length"], head.body), (200, "10000", b""))
        for wanted, status, body, said in [
            ("bytes=5-8", 206, content[5:9], "bytes 5-8/10000"),
            ("bytes=9990-20000", 206, content[9990:], "bytes 9990-9999/10000"),
            ("bytes=-7", 206, content[-7:], "bytes 9993-9999/10000"),
            ("bytes=-70000", 206, content, "bytes 0-9999/10000"),
            ("bytes=0-0,5-6", 200, content, None),
            ("bytes=8-5", 200, content, None),
        ]:
            part = self.server.get(path, f"Range: {wanted}")
            self.assertEqual((part.status, part.body, part.headers.get("content-range")), (status, body, said), wanted)
        beyond = self.server.get(path, "Range: bytes=10000-")
        self.assertEqual((beyond.status, beyond.headers["content-range"]), (416, "bytes */10000"))
        beyond.problem()
        same = self.server.get(path, f"If-None-Match: \"x\", W/{tag}")
        self.assertEqual((same.status, same.body, "content-length" in same.headers), (304, b"", False))
        for if_range, status in [(tag, 206), ('"other"', 200), ("W/" + tag, 200)]:
            self.assertEqual(self.server.get(path, "Range: bytes=0-1", f"If-Range: {if_range}").status, status)
        (FOLDER / "empty").write_bytes(b"")
        self.assertEqual(self.server.get("/files/empty").headers["content-length"], "0")
        (FOLDER / "link").symlink_to("/etc/passwd")
        os.mkfifo(FOLDER / "fifo")
        for bad in ["none", "..%2f..%2fetc%2fpasswd%2fx", "..", "link", "fifo"]:
            self.assertIn(self.server.get("/files/" + bad).status, [400, 404], bad)

    def test_negotiation(self):
        self.assertEqual(self.server.get("/choice", "Accept: text/csv, */*;q=0.1").body, b"csv")
        self.assertEqual(self.server.get("/choice?f=csv", "Accept: application/json").body, b"csv")
        refused = self.server.get("/choice", "Accept: image/png")
        self.assertEqual(refused.status, 406)
        self.assertIn("text/csv", refused.problem()["detail"])

    def test_events(self):
        answer = self.server.get("/events")
        self.assertEqual(answer.headers["content-type"], "text/event-stream")
        self.assertEqual(answer.body.count(b"event: progress"), 5)
        self.assertTrue(answer.body.startswith(b"retry: 1000\n\nid: 1\nevent: progress\ndata: {\"n\":1}\n\n"))
        start = time.monotonic()
        later = self.server.get("/events", "Last-Event-ID: 2").body
        self.assertEqual([line for line in later.split(b"\n") if line.startswith(b"id")], [b"id: 3", b"id: 4", b"id: 5"])
        self.assertGreater(time.monotonic() - start, 0.09)  # throttled: 50 ms between events

    def test_heartbeats_and_the_cap_on_streams(self):
        request = b"GET /events?silent=1 HTTP/1.1\r\nHost: x\r\n\r\n"
        with self.server.connect() as one, self.server.connect() as two:
            one.sendall(request)
            two.sendall(request)
            time.sleep(0.7)
            self.assertGreaterEqual(one.recv(4096).count(b"\n:\n"), 2)
            third = self.server.get("/events")
            self.assertEqual((third.status, third.headers["retry-after"]), (503, "10"))
            third.problem()
        time.sleep(0.5)  # the places of clients that left are free again
        self.assertEqual(self.server.get("/events").status, 200)


class Draining(unittest.TestCase):
    def drain(self, *requests):
        """Sends each on its own connection, then SIGTERM; the answers, the exit code and the seconds it took."""
        with Server("guarded") as server:
            clients = [server.connect() for _ in requests]
            for client, request in zip(clients, requests):
                client.sendall(request)
            time.sleep(0.3)
            start = time.monotonic()
            server.process.send_signal(signal.SIGTERM)
            answers = [receive_all(client) for client in clients]
            ended = time.monotonic() - start
            code = server.process.wait(timeout=15)
            for client in clients:
                client.close()
            return answers, code, ended

    def test_idle_connections_and_streams_end_and_work_is_finished(self):
        idle = b"GET /small HTTP/1.1\r\nHost: x\r\n\r\n"
        (small, stream, slow), code, seconds = self.drain(
            idle, b"GET /events?endless=1 HTTP/1.1\r\nHost: x\r\n\r\n", b"GET /slow HTTP/1.1\r\nHost: x\r\n\r\n")
        self.assertTrue(small.endswith(b"ok"))
        self.assertIn(b"id: 2", stream)
        self.assertTrue(slow.endswith(b"slow"))
        self.assertEqual(Answer(slow).headers["connection"], "close")
        self.assertEqual(code, 0)
        self.assertLess(seconds, 2)

    def test_idle_connections_do_not_delay_the_end(self):
        _, code, seconds = self.drain(b"GET /small HTTP/1.1\r\nHost: x\r\n\r\n")
        self.assertEqual(code, 0)
        self.assertLess(seconds, 0.5)

    def test_what_takes_longer_than_the_deadline_is_cut_and_said_so(self):
        (stuck,), code, _ = self.drain(b"GET /stuck HTTP/1.1\r\nHost: x\r\n\r\n")
        self.assertEqual((stuck, code), (b"", 3))


if __name__ == "__main__":
    with open(FOLDER / "blob", "wb") as file:
        file.write(b"b" * BLOB)
    try:
        outcome = unittest.main(exit=False).result
    finally:
        shutil.rmtree(FOLDER)
    for row in WRITTEN:
        print(" | ".join(row))
    sys.exit(not outcome.wasSuccessful())
