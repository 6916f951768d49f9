"""Jobs on a real service."""
import hashlib
import io
import json
import subprocess
import threading
import unittest
from contextlib import redirect_stderr

import gonio
import numpy as np
from gonio.transport import Body, Transport
from support import GONIO, JOB, LONG, MATERIAL, MEASURE, MEDIUM, ROOT, SURFACE, Proxy, Service, ServiceTest, until

LAVA = ROOT / "tests/samples/lava_rock_256_16bit.png"
LAVA_UNITS = {"width": "50mm", "height_range": "5mm", "resample": [32, 32]}
ROUGH = {"accuracy": {"samples": {"replicates": 2}}}


def relief() -> np.ndarray:
    """Not symmetric in any way, so that rows, columns and signs cannot be mixed up unseen."""
    y, x = np.mgrid[0:24, 0:16]
    return np.sin(2 * np.pi * x / 16) * (1 + y / 24) + np.where((x < 5) & (y < 7), 1.5, 0) + 0.02 * y


class Jobs(ServiceTest):
    def setUp(self):
        super().setUp()
        self.client = gonio.Client(self.service.url)

    def local_bytes(self, document, format="csv"):
        """What `gonio run` writes."""
        job = self.folder / "local.json"
        job.write_text(json.dumps(document | {"output": [{"format": format, "path": f"local.{format}"}]}))
        subprocess.run([GONIO, "run", job, "-q", "-o", self.folder], check=True)
        return (self.folder / f"local.{format}").read_bytes()

    def test_array_gives_the_bytes_of_the_program(self):
        for dtype in (np.float32, np.int16):
            heights = (relief() * 50).astype(dtype)
            np.save(self.folder / "relief.npy", heights)
            units = {"pitch_x": "2 um", "pitch_y": "3 um", "height_scale": "20 nm"}
            job = JOB | ROUGH | {"surface": {"file": str(self.folder / "relief.npy"), **units}}
            surface = self.client.upload(np.asfortranarray(heights), **units)
            done = self.client.submit(job, surface=surface).wait()
            expected = self.local_bytes(job)
            self.assertEqual(done.read("table", "csv"), expected)
            self.assertEqual(done.fetch(self.folder / "fetched.csv").read_bytes(), expected)
            grid = gonio.run(job, surface={"grid": heights, **units}, program=GONIO)
            np.testing.assert_array_equal(grid.values, done.table().values)
            done = self.client.submit(job, surface={"grid": heights, **units}).wait()
            self.assertEqual(done.read("table", "csv"), expected)

    def test_document_with_a_file_beside_it(self):
        (self.folder / "lava.png").write_bytes(LAVA.read_bytes())
        job = JOB | ROUGH | {"surface": {"file": "lava.png", **LAVA_UNITS}, "output": [{"format": "csv"}]}
        (self.folder / "job.json").write_text(json.dumps(job))
        done = self.client.submit(self.folder / "job.json").wait()
        self.assertEqual(done.read("table", "csv"), self.local_bytes(job))
        np.testing.assert_array_equal(gonio.run(self.folder / "job.json", program=GONIO).values, done.table().values)

    def test_what_the_server_has_is_not_sent_again(self):
        proxy = self.proxy()
        client = gonio.Client(proxy.url)
        heights = relief() + 7
        self.assertEqual(client.upload(heights), client.upload(heights))
        self.assertEqual((proxy.count("HEAD"), proxy.count("PUT")), (2, 1))

    def test_masked_points_are_missing_points(self):
        heights = np.ma.masked_greater(relief(), 2.2)
        surface = self.client.upload(heights, pitch="1 um", height_scale="1 um")
        with self.assertRaises(gonio.ApiError) as caught:
            self.client.submit(JOB, surface=surface)
        self.assertIn("missing", str(caught.exception))
        job = self.client.submit(JOB | ROUGH, surface=surface | {"missing": "interpolate"}).wait()
        self.assertEqual(job.last.status, "successful")

    def test_bad_arrays_are_refused_here(self):
        for array in (np.zeros(3), np.zeros((2, 2, 2)), np.zeros((2, 2), complex), np.zeros((0, 4)), [["a"]]):
            with self.assertRaises(gonio.Refused):
                self.client.upload(array)
        with self.assertRaises(gonio.Refused):
            self.client.upload(self.folder / "nothing.png")

    def test_bad_fields_are_named(self):
        for members, pointer in (({"material": {"model": "lambertian", "albedo": 2}}, "/material/albedo"),
                                 ({"surface": SURFACE | {"sampels": 3}}, "/surface/sampels"),
                                 ({"nonsense": 1}, "/nonsense")):
            with self.assertRaises(gonio.ApiError) as caught:
                self.client.submit(JOB, **members)
            self.assertEqual((caught.exception.status, caught.exception.pointer), (400, pointer))
            self.assertIn(pointer, str(caught.exception))
        for members in ({"material": {"model": "lambertian", "albedo": float("nan")}}, {"material": object()}):
            with self.assertRaises(gonio.Refused):
                self.client.submit(JOB, **members)
        with self.assertRaises(gonio.ApiError) as caught:
            self.client.job("none")
        self.assertEqual((caught.exception.status, caught.exception.type.rsplit("/")[-1]), (404, "no-such-job"))

    def test_numpy_numbers_in_the_document(self):
        angles = {"theta_deg": np.linspace(0, 60, 3), "phi_deg": [np.float32(0)]}
        table = self.client.run(JOB, measure=MEASURE | {"outgoing": angles})
        np.testing.assert_array_equal(table.coords["theta_o"], [0, 30, 60])

    def test_cancel(self):
        job = self.client.submit(LONG)
        with self.assertRaises(gonio.TimedOut):
            job.wait(timeout=0.2)
        self.assertIn(job.status().status, ("accepted", "running"))
        self.assertEqual(job.cancel().status, "dismissed")
        with self.assertRaises(gonio.JobDismissed):
            job.wait()
        with self.assertRaises(gonio.JobDismissed):
            self.client.job(job.id).wait()
        with self.assertRaises(gonio.ApiError):
            job.table()

    def test_failed_job(self):
        first = self.client.submit(LONG)
        heights = relief() + 3
        job = self.client.submit(JOB, surface=self.client.upload(heights, pitch="1 um", height_scale="1 um"))
        content = io.BytesIO()
        np.save(content, heights)
        # Its surface goes while it waits.
        name = hashlib.sha256(content.getvalue()).hexdigest()
        [stored] = [path for path in (self.service.folder / "data").rglob("*")
                    if path.is_file() and "".join(path.parts).endswith(name)]
        stored.unlink()
        first.cancel()
        with self.assertRaises(gonio.JobFailed) as caught:
            job.wait()
        self.assertEqual(caught.exception.job, job.id)
        self.assertIn("sha256", caught.exception.message)

    def test_progress(self):
        seen = []
        with redirect_stderr(io.StringIO()) as text:
            job = self.client.submit(MEDIUM)
            job.wait(progress=seen.append)
            self.client.submit(MEDIUM).wait(progress=True)
        self.assertEqual(seen[-1].status, "successful")
        self.assertEqual({status.id for status in seen}, {job.id})
        # Equal jobs are computed once, so the second is done when it is accepted and shows nothing.
        self.assertEqual(text.getvalue(), "")

    def test_list(self):
        jobs = [self.client.submit(JOB, material=MATERIAL | {"albedo": albedo}).wait().id for albedo in (0.1, 0.2, 0.3)]
        self.assertEqual([job.id for job, _ in zip(self.client.jobs(page=2), jobs)], jobs[::-1])
        self.assertGreaterEqual({job.id for job in self.client.jobs(status="successful", process="brdf")}, set(jobs))
        self.assertEqual(list(self.client.jobs(status="running,accepted")), [])
        self.assertIn("surface", self.client.process("brdf")["inputs"])

    def test_report_and_outputs(self):
        job = self.client.submit(JOB).wait()
        self.assertEqual(job.report()["job_hash"], job.last.info["job_hash"])
        for output in job.outputs():
            path = job.fetch(self.folder / f"{output.name}.{output.format}", output.name)
            content = path.read_bytes()
            self.assertEqual((len(content), hashlib.sha256(content).hexdigest()), (output.size, output.sha256))
        with self.assertRaises(gonio.Refused) as caught:
            job.fetch(self.folder / "table.xyz")
        self.assertIn("table as csv", str(caught.exception))
        path = job.fetch(self.folder / "without_ending", format="json")
        self.assertEqual(path.read_bytes(), job.read("table", "json"))

    def test_key_of_ones_own(self):
        first = self.client.submit(JOB, key="a").wait()
        self.assertEqual(gonio.Client(self.service.url).submit(JOB, key="a").id, first.id)
        with self.assertRaises(gonio.ApiError) as caught:
            self.client.submit(JOB | ROUGH, key="a")
        self.assertEqual(caught.exception.status, 422)


class Restart(unittest.TestCase):
    def test_restart_while_waiting(self):
        service = Service()
        self.addCleanup(service.stop)
        proxy = Proxy(service.port)
        self.addCleanup(proxy.close)
        seen = []

        def restart():
            until(lambda: proxy.refused >= 2)
            service.start()
            proxy.port = service.port

        restarter = threading.Thread(target=restart)

        def progress(status):
            seen.append(status.status)
            if not restarter.ident:  # the first event comes at once
                service.kill()
                restarter.start()

        job = gonio.Client(proxy.url).submit(MEDIUM)
        job.wait(progress=progress)
        restarter.join()
        self.assertGreaterEqual(proxy.refused, 2)
        self.assertEqual(seen[-1], "successful")
        local = gonio.run(MEDIUM, program=GONIO)
        np.testing.assert_array_equal(job.table().values, local.values)


class Tokens(unittest.TestCase):
    def test_token_file(self):
        plain = Service()
        self.addCleanup(plain.stop)
        tokens = plain.folder / "tokens"
        tokens.write_text("alice 0123456789abcdef0123456789abcdef\n")
        tokens.chmod(0o600)
        service = Service("--token-file", str(tokens))
        self.addCleanup(service.stop)
        for client in (gonio.Client(service.url, token_file=tokens),
                       gonio.Client(service.url, token="0123456789abcdef0123456789abcdef")):
            self.assertEqual(list(client.jobs()), [])
        with self.assertRaises(gonio.ApiError) as caught:
            gonio.Client(service.url).processes()
        self.assertEqual(caught.exception.status, 401)
        # Refused long before all of it is sent: the answer is seen all the same.
        body = Body(lambda: io.BytesIO(bytes(50 << 20)), 50 << 20, "application/octet-stream")
        with self.assertRaises(gonio.ApiError) as caught:
            Transport(service.url, None, timeout=60, patience=0).open("PUT", "surfaces/" + "0" * 64, body)
        self.assertEqual(caught.exception.status, 401)
        for wrong in ({"token": "two words"}, {"token": "a\r\nHost: b"}, {"token_file": plain.folder / "none"}):
            with self.assertRaises(gonio.Refused):
                gonio.Client(service.url, **wrong)
        for url in ("localhost:8080", "ftp://a", "http://"):
            with self.assertRaises(gonio.Refused):
                gonio.Client(url)


if __name__ == "__main__":
    unittest.main()
