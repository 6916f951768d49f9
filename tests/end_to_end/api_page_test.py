#!/usr/bin/env python3
"""Runs the curl lines of server/API.md against a service.

Usage: api_page_test.py GONIO SOURCE_FOLDER [unittest options]
"""
import json
import re
import shutil
import subprocess
import unittest

from service_fixture import LAVA, SOURCE, Service


class Page(Service):
    def test_curl_lines(self):
        page = (SOURCE / "server/API.md").read_text()
        script = re.search(r"```sh\n(.*?)```", page, re.S).group(1)
        self.assertIn("url=http://127.0.0.1:8080\n", script)
        script = script.replace("http://127.0.0.1:8080", self.url)
        # Whatever fails, in a pipe too, fails the test.
        shutil.copy(LAVA, self.folder / "lava.png")
        done = subprocess.run(["bash", "-euo", "pipefail", "-c", script], cwd=self.folder, capture_output=True, text=True, timeout=300)
        self.assertEqual(done.returncode, 0, done.stderr + done.stdout[-2000:])
        job = json.loads((self.folder / "accepted.json").read_text())["jobID"]
        self.assertEqual((self.folder / "lava.csv").read_bytes(), self.table(job))
        self.assertEqual((self.folder / "lava.exr").read_bytes(), self.table(job, "exr"))
        self.assertIn("event: successful", done.stdout)

    def test_every_route_is_on_the_page(self):
        page = (SOURCE / "server/API.md").read_text()
        for path in self.call("GET", "/api")[1]["paths"]:
            words = [word for word in path.split("/") if word and not word.startswith("{")]
            for word in words:
                self.assertIn(word, page, path)


if __name__ == "__main__":
    unittest.main()
