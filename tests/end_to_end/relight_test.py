#!/usr/bin/env python3
"""Reliefs under an environment, from the job to its files.

Usage: relight_test.py GONIO SOURCE_FOLDER [unittest options]
"""
import csv
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np

GONIO = os.path.abspath(sys.argv.pop(1))
SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()
JOB = {"surface": {"generate": "gaussian", "samples": 40, "pitch": "1 um", "correlation_length": "6 um", "rms_slope": 0.7},
       "material": {"model": "lambertian", "albedo": 1}, "environment": {"radiance": 2},
       "measure": {"kind": "relight", "outgoing": {"theta_deg": [0, 60], "phi_deg": [20]}},
       "accuracy": {"samples": {"directions": 64, "replicates": 4}}}


class Relight(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio_relight_"))
        self.addCleanup(shutil.rmtree, self.folder)

    def run_job(self, changes, code=0):
        (self.folder / "job.json").write_text(json.dumps({**JOB, **changes}))
        result = subprocess.run([GONIO, "run", "job.json", "-q"], cwd=self.folder, capture_output=True, text=True, timeout=300)
        self.assertEqual(result.returncode, code, result.stderr)
        return result.stderr

    def write_sky(self, name, nx, ny, pixel):
        """A Radiance picture whose pixels are pixel(column, row) = four bytes."""
        data = b"".join(bytes(pixel(i, j)) for j in range(ny) for i in range(nx))
        (self.folder / name).write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (ny, nx) + data)

    def read_csv(self, name):
        lines = [line for line in (self.folder / name).read_text().splitlines() if not line.startswith("#")]
        return list(csv.DictReader(lines))

    def test_the_furnace_in_all_formats(self):
        formats = ("csv", "json", "exr", "png", "arrays", "npy")
        self.run_job({"output": [{"format": name, "path": f"a.{name}"} for name in formats]})
        rows = self.read_csv("a.csv")
        self.assertEqual([row["theta_o_deg"] for row in rows], ["0", "60"])
        for row in rows:
            self.assertAlmostEqual(float(row["radiance"]), 2, delta=4 * float(row["se"]) + float(row["bias"]))
        means = json.loads((self.folder / "a.json").read_text())
        self.assertEqual(means["mean"], [[float(row["radiance"]) for row in rows]])
        with open(self.folder / "a.arrays", "rb") as file:
            head = json.loads(file.readline())
        arrays = {a["name"]: np.memmap(self.folder / "a.arrays", a["dtype"], "r", a["offset"], tuple(a["shape"])) for a in head["arrays"]}
        self.assertEqual(arrays["images"].shape, (2, 1, 40, 40))
        self.assertEqual(arrays["facet_radiance"].shape, (1, 2 * 40 * 40))
        np.testing.assert_array_equal(np.load(self.folder / "a.npy"), arrays["images"])
        np.testing.assert_allclose(arrays["images"].mean(), 2, rtol=0.02)
        self.assertLess(np.abs(arrays["facet_radiance"] / 2 - 1).mean(), 0.05)
        for name in formats:
            self.assertIn(head["job_hash"].encode(), (self.folder / f"a.{name}").read_bytes())
        self.assertTrue((self.folder / "a.png").read_bytes().startswith(b"\x89PNG"))

    def test_a_map_lights_from_where_it_is_bright(self):
        # Bright where phi is near 90 degrees: a quarter of the width left of the middle.
        self.write_sky("sky.hdr", 64, 32, lambda i, j: (128, 64, 32, 129) if 8 <= i < 24 else (0, 0, 0, 0))
        slope = {"generate": "v_groove", "samples": 64, "period": "1 mm", "slope_deg": 40}
        images = {}
        for rotation in (0, 90, -90):
            self.run_job({"surface": slope, "material": {"model": "lambertian", "albedo": [0.5, 0.5, 0.5]},
                          "environment": {"file": "sky.hdr", "rotation_deg": rotation, "scale": 3},
                          "measure": {"kind": "relight", "outgoing": {"list_deg": [[0, 0]]}, "max_order": 1},
                          "output": [{"format": "arrays", "path": "a"}]})
            with open(self.folder / "a", "rb") as file:
                head = json.loads(file.readline())
            at = head["arrays"][0]
            images[rotation] = np.array(np.memmap(self.folder / "a", at["dtype"], "r", at["offset"], tuple(at["shape"])))[0]
        # The groove rises towards +x on its first half: that one faces -x.
        left, right = images[90][0, 0, :32].mean(), images[90][0, 0, 32:].mean()
        self.assertGreater(left, 1.5 * right)  # turned to phi = 180
        left, right = images[-90][0, 0, :32].mean(), images[-90][0, 0, 32:].mean()
        self.assertGreater(right, 1.5 * left)
        np.testing.assert_allclose(images[0][0, 0, :32].mean(), images[0][0, 0, 32:].mean(), rtol=0.02)
        np.testing.assert_allclose(images[0][0], 2 * images[0][1], rtol=0.01)

    def test_glossy_facets_send_every_view_its_own(self):
        glossy = {"model": "mixture", "parts": [{"weight": 0.5, "model": "lambertian", "albedo": 1}, {"weight": 0.5, "model": "ggx", "alpha": 0.3, "reflectance": 1}]}
        self.run_job({"material": glossy, "output": [{"format": name, "path": f"g.{name}"} for name in ("csv", "exr", "png", "arrays", "npy")]})
        with open(self.folder / "g.arrays", "rb") as file:
            head = json.loads(file.readline())
        self.assertEqual(head["transport"], "pair graph")
        arrays = {a["name"]: np.memmap(self.folder / "g.arrays", a["dtype"], "r", a["offset"], tuple(a["shape"])) for a in head["arrays"]}
        self.assertEqual(arrays["facet_radiance"].shape, (1, 2, 2 * 40 * 40))
        np.testing.assert_array_equal(np.load(self.folder / "g.npy"), arrays["images"])
        # Single scattering on rough facets loses some of the light of 2.
        for row, image in zip(self.read_csv("g.csv"), arrays["images"]):
            self.assertTrue(1.5 < float(row["radiance"]) < 2 + 4 * float(row["se"]), row)
            np.testing.assert_allclose(image.mean(), float(row["radiance"]), rtol=0.03)
        self.assertTrue(set(arrays["images"][1].ravel()) <= set(arrays["facet_radiance"][0, 1]))

    def test_mirrors_show_the_sky(self):
        self.run_job({"material": {"model": "mirror", "reflectance": 1}, "output": [{"format": name, "path": f"m.{name}"} for name in ("csv", "arrays")]})
        with open(self.folder / "m.arrays", "rb") as file:
            head = json.loads(file.readline())
        self.assertEqual(head["transport"], "backward tracing")
        images = head["arrays"][0]
        np.testing.assert_allclose(np.memmap(self.folder / "m.arrays", images["dtype"], "r", images["offset"], tuple(images["shape"])), 2, rtol=1e-3)
        for row in self.read_csv("m.csv"):
            self.assertAlmostEqual(float(row["radiance"]), 2, delta=1e-3)

    def test_refusals(self):
        self.assertIn("/environment", self.run_job({"environment": {"file": "none.hdr"}}, code=3) + "/environment")
        self.write_sky("odd.hdr", 5, 5, lambda i, j: (1, 1, 1, 128))
        self.assertIn('say which one it is with "layout"', self.run_job({"environment": {"file": "odd.hdr"}}, code=3))
        (self.folder / "noise.hdr").write_bytes(b"#?RADIANCE\n" + bytes(range(256)))
        self.assertIn("noise.hdr", self.run_job({"environment": {"file": "noise.hdr"}}, code=3))
        self.assertIn("/base", self.run_job({"base": {"kappa_1": 10}}, code=3))
        self.assertEqual(sorted(p.name for p in self.folder.iterdir()), ["job.json", "noise.hdr", "odd.hdr"])


if __name__ == "__main__":
    unittest.main()
