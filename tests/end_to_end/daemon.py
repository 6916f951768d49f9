"""A `gonio serve` on a port of this machine, for the tests that start, ask and kill one."""
import http.client
import json
import os
import pathlib
import re
import subprocess


class Daemon:
    def __init__(self, gonio, data):
        self.gonio, self.data, self.port, self.process = gonio, pathlib.Path(data), 0, None

    def start(self, *options, port=0, env=None, stderr=None):
        """On any port, or on one that clients know already; `env` is added to ours, `stderr` a file."""
        self.process = subprocess.Popen([self.gonio, "serve", "--data", str(self.data), "--listen", f"127.0.0.1:{port}",
                                         "--threads", "1", *options], stdout=subprocess.PIPE, stderr=stderr, text=True,
                                        env={**os.environ, **(env or {})})
        line = self.process.stdout.readline()
        match = re.fullmatch(r"listening on http://127\.0\.0\.1:(\d+)\n", line)
        if not match:
            raise RuntimeError(f"the daemon did not start: exit code {self.process.wait()}, {line!r}")
        self.port = int(match.group(1))

    def kill(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}"

    def ask(self, method, path, body=None, **headers):
        """Status, headers, and the body: parsed if it is JSON. "_" in the name of a header stands for "-"."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        try:
            if isinstance(body, dict):
                body = json.dumps(body)
                headers.setdefault("Content-Type", "application/json")
            connection.request(method, path, body, {name.replace("_", "-"): value for name, value in headers.items()})
            response = connection.getresponse()
            data = response.read()
            is_json = "json" in (response.headers["Content-Type"] or "")
            return response.status, response.headers, json.loads(data) if is_json and data else data
        finally:
            connection.close()

    def memory_mib(self):
        text = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s+(\d+) kB", text).group(1)) / 1024
