#!/usr/bin/env python3
"""deploy/nginx/gonio.conf between TLS clients and a real service, in a temporary folder with a certificate of its own.

Usage: nginx_test.py GONIO [unittest options]
"""
import hashlib
import http.client
import json
import os
import pathlib
import re
import shutil
import socket
import ssl
import subprocess
import sys
import tempfile
import time
import unittest

GONIO = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE = pathlib.Path(__file__).resolve().parents[2]
NAME = "gonio.example.org"
TOKEN = "a-token-of-the-test"
HEMISPHERE = {"hemisphere": 16}


def surface(values: bytes) -> dict:
    return {"sha256": hashlib.sha256(values).hexdigest(), "width": "1 mm", "height_range": "0.1 mm"}


def job(surface_section: dict, target: float = 0.01) -> dict:
    return {"inputs": {"surface": surface_section, "material": {"model": "lambertian", "albedo": 0.5},
                       "measure": {"kind": "brdf", "incident": HEMISPHERE, "outgoing": HEMISPHERE},
                       "accuracy": {"target_relative_error": target}}}


# Minutes of work: only a dismissal ends it.
LONG_JOB = job({"generate": "gaussian", "samples": 512, "pitch": "1 um", "correlation_length": "4 um",
                "rms_slope": 1}, 1e-6)


class Connection(http.client.HTTPSConnection):
    """TLS over nginx's socket: a name instead of a port, so no two tests can meet."""

    def __init__(self, path: pathlib.Path, context: ssl.SSLContext):
        super().__init__(NAME, timeout=60, context=context)
        self.path, self.context = path, context

    def connect(self) -> None:
        plain = socket.socket(socket.AF_UNIX)
        plain.settimeout(60)
        plain.connect(str(self.path))
        self.sock = self.context.wrap_socket(plain, server_hostname=NAME)


class BehindNginx(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio_nginx_"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.folder.chmod(0o755)  # nginx's workers are another user
        cls.start_gonio()
        cls.start_nginx()

    @classmethod
    def start(cls, *command, **options) -> subprocess.Popen:
        process = subprocess.Popen(command, **options)
        cls.addClassCleanup(process.wait)
        cls.addClassCleanup(process.terminate)
        return process

    @classmethod
    def start_gonio(cls) -> None:
        tokens = cls.folder / "tokens"
        tokens.touch(0o600)
        tokens.write_text(f"test {TOKEN}\n")
        cls.data = cls.folder / "data"
        service = cls.start(GONIO, "serve", "--data", cls.data, "--listen", "127.0.0.1:0", "--token-file", tokens,
                            stdout=subprocess.PIPE, text=True)
        cls.addClassCleanup(service.stdout.close)
        cls.port = int(re.search(r":(\d+)$", service.stdout.readline()).group(1))

    @classmethod
    def start_nginx(cls) -> None:
        folder = cls.folder
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes",
                        "-days", "1", "-subj", f"/CN={NAME}", "-addext", f"subjectAltName=DNS:{NAME}",
                        "-keyout", folder / "key.pem", "-out", folder / "cert.pem"], check=True, capture_output=True)
        cls.tls, cls.plain = folder / "tls.socket", folder / "plain.socket"
        site = (SOURCE / "deploy/nginx/gonio.conf").read_text()
        for ours, theirs in {"server 127.0.0.1:8080;": f"server 127.0.0.1:{cls.port};",
                             "listen 80;": f"listen unix:{cls.plain};",
                             "listen 443 ssl http2;": f"listen unix:{cls.tls} ssl http2;",
                             "/etc/ssl/certs/gonio.pem": str(folder / "cert.pem"),
                             "/etc/ssl/private/gonio.key": str(folder / "key.pem")}.items():
            assert site.count(ours) == 1, ours
            site = site.replace(ours, theirs)
        (folder / "site.conf").write_text(site)
        places = "".join(f"{kind}_temp_path {folder / kind};"
                         for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
        (folder / "nginx.conf").write_text(
            f"daemon off; pid {folder / 'pid'}; error_log {folder / 'error.log'};\n"
            f"events {{}}\nhttp {{ access_log off; {places} include {folder / 'site.conf'}; }}\n")
        nginx = cls.start("/usr/sbin/nginx", "-p", folder, "-c", folder / "nginx.conf", "-e", folder / "error.log")
        while not cls.tls.exists():
            assert nginx.poll() is None, (folder / "error.log").read_text()
            time.sleep(0.05)
        cls.context = ssl.create_default_context(cafile=folder / "cert.pem")

    def call(self, method: str, path: str, body: bytes | dict | None = None, **headers: str) -> tuple[int, bytes]:
        connection = Connection(self.tls, self.context)
        self.addCleanup(connection.close)
        if isinstance(body, dict):
            body = json.dumps(body).encode()
            headers.setdefault("Content-Type", "application/json")
        headers.setdefault("Authorization", f"Bearer {TOKEN}")
        connection.request(method, path, body, {name.replace("_", "-"): value for name, value in headers.items()})
        response = connection.getresponse()
        self.headers = response.headers
        return response.status, response.read()

    def submit(self, document: dict) -> str:
        status, body = self.call("POST", "/processes/brdf/execution", document)
        self.assertEqual(status, 201, body)
        return json.loads(body)["jobID"]

    def test_a_job_from_upload_to_table(self):
        bytes_of_surface = (SOURCE / "tests/samples/tiles_256_8bit.png").read_bytes()
        section = surface(bytes_of_surface)
        status, body = self.call("PUT", f"/surfaces/{section['sha256']}", bytes_of_surface)
        self.assertIn(status, (200, 201, 204), body)
        job_id = self.submit(job(section, 0.1))
        status, events = self.call("GET", f"/jobs/{job_id}/events")  # ends with the job
        self.assertEqual(status, 200)
        self.assertIn(b"event: successful", events)
        status, table = self.call("GET", f"/jobs/{job_id}/results/table?f=csv")
        self.assertEqual(status, 200)
        status, part = self.call("GET", f"/jobs/{job_id}/results/table?f=csv", Range="bytes=10-19")
        self.assertEqual((status, part), (206, table[10:20]))

    def test_events_come_while_the_job_runs(self):
        job_id = self.submit(LONG_JOB)
        connection = Connection(self.tls, self.context)
        self.addCleanup(connection.close)
        connection.request("GET", f"/jobs/{job_id}/events", headers={"Authorization": f"Bearer {TOKEN}"})
        response = connection.getresponse()
        self.assertEqual(response.status, 200)
        # A buffering proxy gives no line: the socket times out.
        while not (line := response.readline()).startswith(b"event:"):
            self.assertTrue(line)
        status, body = self.call("GET", f"/jobs/{job_id}")
        self.assertIn(json.loads(body)["status"], ("accepted", "running"))
        self.assertEqual(self.call("DELETE", f"/jobs/{job_id}")[0], 200)

    def test_an_upload_reaches_the_service_before_it_ends(self):
        half = os.urandom(8 << 20)
        name = hashlib.sha256(half + half).hexdigest()
        connection = Connection(self.tls, self.context)
        self.addCleanup(connection.close)
        connection.putrequest("PUT", f"/surfaces/{name}")
        connection.putheader("Authorization", f"Bearer {TOKEN}")
        connection.putheader("Content-Length", str(2 * len(half)))
        connection.endheaders(half)
        end = time.monotonic() + 30
        while not any(path.stat().st_size >= 1 << 20 for path in (self.data / "tmp").iterdir()):
            self.assertLess(time.monotonic(), end, "nothing has reached the service's disk")
            time.sleep(0.05)
        connection.send(half)
        response = connection.getresponse()
        body = response.read()
        # Random bytes are no height field: it may refuse them, but only now, when it has them all.
        self.assertIn(response.status, (200, 201, 204, 422), body)

    def test_too_large_is_a_problem_document_at_once(self):
        for path, size in (("/surfaces/" + "0" * 64, 2 << 30), ("/processes/brdf/execution", 17 << 20)):
            connection = Connection(self.tls, self.context)
            self.addCleanup(connection.close)
            connection.putrequest("PUT" if "surfaces" in path else "POST", path)
            connection.putheader("Authorization", f"Bearer {TOKEN}")
            connection.putheader("Content-Type", "application/json")
            connection.putheader("Content-Length", str(size))
            connection.endheaders()  # and no byte of the body
            response = connection.getresponse()
            self.assertEqual(response.status, 413, path)
            self.assertIn("application/problem+json", response.headers["Content-Type"])
            self.assertEqual(json.loads(response.read())["status"], 413)

    def test_without_a_token(self):
        self.assertEqual(self.call("GET", "/jobs", Authorization="Bearer of-something-else")[0], 401)
        self.assertEqual(self.call("GET", "/healthz", Authorization="")[0], 200)

    def test_strict_transport_security_on_answers_of_both(self):
        for path in ("/healthz", "/nothing"):
            self.call("GET", path)
            self.assertIn("max-age=", self.headers["Strict-Transport-Security"] or "")

    def curl(self, *arguments: str) -> str:
        return subprocess.run(["curl", "--silent", "--show-error", "--cacert", self.folder / "cert.pem", *arguments],
                              check=True, capture_output=True, text=True, timeout=60).stdout

    def test_http_2(self):
        answer = self.curl("--unix-socket", str(self.tls), "--http2", "-w", "%{http_version} %{http_code}",
                           "-o", "/dev/null", f"https://{NAME}/healthz")
        self.assertEqual(answer, "2 200")

    def test_plain_http_is_sent_to_tls(self):
        answer = self.curl("--unix-socket", str(self.plain), "-w", "%{http_code} %{redirect_url}",
                           "-o", "/dev/null", f"http://{NAME}/jobs?limit=1")
        self.assertEqual(answer, f"308 https://{NAME}/jobs?limit=1")


if __name__ == "__main__":
    unittest.main(verbosity=2)
