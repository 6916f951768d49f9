"""Servers that refuse for a while, connections that break, bytes that change on the way."""
import email.utils
import hashlib
import json
import socket
import time
from unittest import mock

import gonio
import numpy as np
from support import JOB, LARGE, Clock, Script, ServiceTest

JSON = {"Content-Type": "application/json"}


def status(name, progress=0):
    return {"jobID": "a", "processID": "brdf", "type": "process", "status": name, "progress": progress}


def reply(body, code=200, **headers):
    return code, JSON | {name.replace("_", "-"): value for name, value in headers.items()}, json.dumps(body).encode()


def stream(*events, after=b""):
    text = "".join(f"id: {number}\nevent: {info['status']}\ndata: {json.dumps(info)}\n\n" for number, info in events)
    return 200, {"Content-Type": "text/event-stream"}, b"retry: 2000\n\n:\n\n" + text.encode() + after


class Answers(ServiceTest):
    """Against scripted answers, on a clock that the pauses alone move."""

    @classmethod
    def setUpClass(cls):
        pass

    def setUp(self):
        super().setUp()
        self.clock = Clock()
        patch = mock.patch("gonio.transport.time", self.clock)
        patch.start()
        self.addCleanup(patch.stop)

    def client(self, *answers, **options):
        self.server = Script(*answers)
        self.addCleanup(self.server.close)
        return gonio.Client(self.server.url, **options)

    def test_retry_after_is_kept(self):
        client = self.client(reply({}, 429, Retry_After="7"), reply({}, 503, Retry_After="2"), reply({}, 502),
                             None, reply(status("accepted"), 201))
        self.assertEqual(client.submit(JOB).id, "a")
        self.assertEqual(len(self.clock.slept), 4)
        self.assertGreaterEqual(self.clock.slept[0], 7)
        self.assertGreaterEqual(self.clock.slept[1], 2)
        keys = {headers["Idempotency-Key"] for _, headers in self.server.requests}
        self.assertEqual((len(self.server.requests), len(keys)), (5, 1))

    def test_each_submission_has_its_key(self):
        client = self.client(reply(status("accepted"), 201), reply(status("accepted"), 201))
        client.submit(JOB), client.submit(JOB)
        self.assertEqual(len({headers["Idempotency-Key"] for _, headers in self.server.requests}), 2)

    def test_retry_after_as_a_date(self):
        date = email.utils.formatdate(time.time() + 3600, usegmt=True)
        client = self.client(reply({}, 503, Retry_After=date), reply({"processes": []}), patience=9999)
        client.processes()
        self.assertGreater(self.clock.slept[0], 3000)

    def test_pauses_grow_and_differ(self):
        client = self.client(*[reply({}, 503)] * 30, reply({"processes": []}), patience=1000)
        with mock.patch("gonio.transport.random.uniform", lambda low, high: high):
            client.processes()
        self.assertEqual(self.clock.slept[:4], [0.2, 0.4, 0.8, 1.6])
        self.assertEqual(max(self.clock.slept), 10)
        self.client(*[reply({}, 503)] * 8, reply({"processes": []})).processes()
        self.assertEqual(len(set(self.clock.slept[30:])), 8)

    def test_patience_ends(self):
        client = self.client(*[reply({"detail": "drains"}, 503)] * 99, patience=20)
        with self.assertRaises(gonio.ApiError) as caught:
            client.processes()
        self.assertEqual((caught.exception.status, str(caught.exception)), (503, "drains"))
        self.assertLessEqual(sum(self.clock.slept), 20)
        # A pause that patience does not cover is not begun.
        slept = len(self.clock.slept)
        client = self.client(reply({}, 429, Retry_After="3600"))
        with self.assertRaises(gonio.ApiError) as caught:
            client.processes()
        self.assertEqual((caught.exception.retry_after, len(self.clock.slept)), (3600, slept))

    def test_refusals_are_final(self):
        problem = {"type": "about:blank", "title": "Unprocessable", "status": 422, "code": "limit", "detail": "the job",
                   "errors": [{"pointer": "/inputs/measure", "detail": "9 GiB: 4 GiB fit"}]}
        client = self.client(reply(problem, 422))
        with self.assertRaises(gonio.ApiError) as caught:
            client.submit(JOB)
        error = caught.exception
        self.assertEqual((error.status, error.code, error.pointer, error.detail, error.problem),
                         (422, "limit", "/measure", "9 GiB: 4 GiB fit", problem))
        self.assertEqual(self.clock.slept, [])

    def test_only_errors_of_the_family(self):
        closed = socket.create_server(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{closed.getsockname()[1]}"
        closed.close()
        for client in (gonio.Client(url, patience=2), gonio.Client("http://no.such.host.invalid", patience=2)):
            with self.assertRaises(gonio.Unreachable):
                client.processes()
        for garbage in ((200, {}, b"<html>"), (200, {"Content-Length": "99"}, b"{}"), b"no HTTP at all\r\n\r\n"):
            with self.assertRaises(gonio.Unreachable):
                self.client(*[garbage] * 99, patience=2).processes()
        garbage = self.client((302, {"Location": "/"}, b""), (404, {}, b"\xff not json"))
        for code in (302, 404):
            with self.assertRaises(gonio.ApiError) as caught:
                garbage.processes()
            self.assertEqual(caught.exception.status, code)

    def test_events_are_taken_up_where_they_broke(self):
        client = self.client(reply(status("accepted"), 201),
                             stream((1, status("accepted")), (2, status("running", 5)), after=b"id: 3\ndata: {"),
                             None,
                             stream((4, status("running", 50)), (5, status("successful", 100))))
        job = client.submit(JOB)
        self.assertEqual([seen.progress for seen in job.events()], [0, 5, 50, 100])
        self.assertEqual([headers.get("Last-Event-ID") for _, headers in self.server.requests[1:]], [None, "2", "2"])

    def test_without_a_stream_the_status_is_asked(self):
        busy = reply({}, 503, Retry_After="10")
        client = self.client(reply(status("accepted"), 201), busy, reply(status("running")),
                             busy, reply(status("successful")), patience=30)
        self.assertEqual(client.submit(JOB).wait().last.status, "successful")

    def test_waiting_never_takes_a_broken_line_for_a_failed_job(self):
        client = self.client(reply(status("running"), 201), *[None] * 99, patience=5)
        with self.assertRaises(gonio.Unreachable):
            client.submit(JOB).wait()
        client = self.client(reply(status("running"), 201), *[None] * 99)
        with mock.patch("gonio.job.time", self.clock), self.assertRaises(gonio.TimedOut):
            client.submit(JOB).wait(timeout=3)


    def test_albedo_maps_are_uploaded(self):
        maps = [self.folder / name for name in ("r.png", "g.png", "b.png")]
        for path in maps:
            path.write_text(path.name)
        there, missing, put, done = (200, {}, b""), reply({}, 404), reply({}, 201), reply(status("accepted"), 201)
        client = self.client(missing, put, done, there, missing, put, missing, put, done)
        client.submit(JOB, material={"albedo": {"file": maps[0]}})
        client.submit(JOB, material={"albedo": {"files": maps}})
        names = [hashlib.sha256(path.name.encode()).hexdigest() for path in maps]
        jobs = [json.loads(body)["inputs"] for body in self.server.bodies if body.startswith(b"{")]
        sent = [job["material"]["albedo"] for job in jobs]
        self.assertEqual(sent, [{"sha256": names[0]}, {"sha256": names}])
        puts = [request for request, _ in self.server.requests if request.startswith("PUT")]
        self.assertEqual(puts, [f"PUT /surfaces/{name}" for name in names])

    def test_what_a_failed_job_says(self):
        problem = {"code": "limit", "field": "", "message": "out of memory"}
        failed = status("failed") | {"message": "out of memory", "problem": problem}
        job = self.client(reply(failed), reply({"surface": {}})).job("a")
        with self.assertRaises(gonio.JobFailed) as caught:
            job.wait()
        self.assertEqual((str(caught.exception), caught.exception.problem), ("job a failed: out of memory", problem))
        self.assertEqual(job.document(), {"surface": {}})
        self.assertEqual(self.server.requests[-1][0], "GET /jobs/a/document")


class Cuts(ServiceTest):
    """Against a real service behind a proxy that cuts."""

    def setUp(self):
        super().setUp()
        self.cuts = self.proxy()
        self.client = gonio.Client(self.cuts.url)

    def test_submission_whose_answer_is_lost_makes_one_job(self):
        before = len(list(self.client.jobs()))

        def harm(line, body):
            return b"" if line.startswith("POST") and self.cuts.count("POST") < 3 else None

        self.cuts.harm = harm
        job = self.client.submit(JOB)
        self.assertEqual(self.cuts.count("POST"), 3)
        self.assertEqual([job.id], [job.id for job in self.client.jobs()][:-before or None])

    def ranges(self):
        lines = [line for head in self.cuts.requests for line in head.split("\r\n")]
        return [line.split(": ")[1] for line in lines if line.startswith("Range")]

    def large(self):
        """A finished job, its table, and the cuts: each download of it ends after 30,000 bytes."""
        job = self.client.submit(LARGE).wait()
        self.cuts.harm = lambda line, body: body[:30000] if "/results/table" in line else None
        return job, gonio.Client(self.service.url).job(job.id).read("table", "csv")

    def test_download_goes_on_where_it_broke(self):
        job, whole = self.large()
        path = job.fetch(self.folder / "table.csv")
        self.assertEqual(path.read_bytes(), whole)
        self.assertEqual(self.ranges(), [f"bytes={begin}-" for begin in range(30000, len(whole), 30000)])
        self.assertGreater(len(self.ranges()), 1)
        self.assertEqual(list(self.folder.iterdir()), [path])
        # What is there is not fetched again.
        n = self.cuts.count("GET /jobs/" + job.id + "/results/table")
        job.fetch(path)
        self.assertEqual(self.cuts.count("GET /jobs/" + job.id + "/results/table"), n)

    def test_download_goes_on_in_a_later_call(self):
        job, whole = self.large()
        path = self.folder / "table.csv"
        with self.assertRaises(gonio.Unreachable):
            gonio.Client(self.cuts.url, patience=0).job(job.id).fetch(path)
        [part] = self.folder.iterdir()
        self.assertNotEqual(part, path)
        self.assertEqual(part.read_bytes(), whole[:30000])
        self.cuts.harm = None
        self.assertEqual(job.fetch(path).read_bytes(), whole)
        self.assertEqual(self.ranges(), ["bytes=30000-"])
        self.assertEqual(list(self.folder.iterdir()), [path])
        # Of what a crash left there nothing is taken that does not fit.
        path.unlink()
        part.write_bytes(b"x" * 1000)
        self.assertEqual(job.fetch(path).read_bytes(), whole)
        self.assertEqual(list(self.folder.iterdir()), [path])

    def test_changed_bytes_are_caught(self):
        job, _ = self.large()
        self.cuts.harm = lambda line, body: body.replace(b"gonio", b"Gonio") if "/results/table" in line else None
        with self.assertRaises(gonio.ChecksumError):
            job.fetch(self.folder / "table.csv")
        self.assertEqual(list(self.folder.iterdir()), [])
        with self.assertRaises(gonio.ChecksumError):
            job.table()

    def test_upload_that_breaks_is_sent_again(self):
        self.cuts.harm = lambda line, body: b"" if line.startswith("PUT") and self.cuts.count("PUT") < 2 else None
        heights = np.arange(12.0).reshape(3, 4)
        surface = self.client.upload(heights)
        self.assertEqual(self.cuts.count("PUT"), 2)
        self.assertEqual(gonio.Client(self.service.url).upload(heights), surface)
