#!/usr/bin/env python3
"""Jobs that ask for spherical harmonics, and `gonio project`: closed forms, files that agree, honest errors.

Usage: projection_test.py GONIO SOURCE_FOLDER [unittest options]
"""
import json
import math
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
sys.path.insert(0, str(SOURCE / "clients/python/src"))
from read_exr import read_exr  # noqa: E402
from gonio import harmonics, read_projection, read_table  # noqa: E402

PLANE = {"generate": "plane", "samples": 2, "pitch": "1 mm"}
EGG_CRATE = {"generate": "egg_crate", "samples": 32, "period": "1 mm", "amplitude": "0.1 mm"}
GROOVE = {"generate": "v_groove", "samples": 16, "period": "1 mm", "slope_deg": 45}
LIGHTS = {"theta_deg": [0, 45], "phi_deg": [20]}


def job(project, surface=PLANE, **measure):
    document = {"surface": surface, "material": {"model": "lambertian", "albedo": [0.8, 0.5, 0.2]},
                "measure": {"kind": "brdf", "project": project, **measure},
                "accuracy": {"samples": {"replicates": 4}},
                "output": [{"format": name, "path": "p." + name} for name in ("json", "csv", "npy", "exr")]}
    if "incident" not in measure and project.get("form", "per_light") == "per_light":
        document["measure"]["incident"] = LIGHTS
    return document


class Projection(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio_projection_"))
        self.addCleanup(shutil.rmtree, self.folder)

    def gonio(self, *arguments, code=0):
        result = subprocess.run([GONIO, *map(str, arguments)], cwd=self.folder, capture_output=True, text=True, timeout=300)
        self.assertEqual(result.returncode, code, result.stderr)
        return result

    def run_job(self, document, *options, code=0):
        (self.folder / "job.json").write_text(json.dumps(document))
        return self.gonio("run", "job.json", *options, code=code)

    def projected(self, document):
        self.run_job(document, "-q")
        return read_projection(self.folder / "p.json")

    def test_plane(self):
        """f = albedo / pi: of HSH only c_00 = f sqrt(2 pi); of f cos cos what the orthonormal c_lm of cos are."""
        for samples in ({}, {"samples": 100}):
            flat = self.projected(job({"basis": "hsh", "order": 4, "weighting": "none", **samples}))
            self.assertEqual(flat.coefficients.shape, (3, 1, 2, 16))
            expected = np.zeros(16)
            for k, albedo in enumerate((0.8, 0.5, 0.2)):
                expected[0] = albedo / math.pi * math.sqrt(2 * math.pi)
                np.testing.assert_allclose(flat.coefficients[k, 0], [expected, expected], atol=1e-6)
            # The clamped cosine of Ramamoorthi & Hanrahan: zonal, zero in odd bands from 3 on.
            cosine = self.projected(job({"basis": "sh", "order": 4}))
            zonal = [0.886226925453, 1.02332670795, 0.495415912201, 0]
            for light, scale in enumerate((1, math.cos(math.pi / 4))):
                for l in range(4):
                    self.assertAlmostEqual(cosine.coefficients[0, 0, light, l * (l + 1)], 0.8 / math.pi * scale * zonal[l], 6)
        for form in ("matrix", "joint"):
            for samples in ({}, {"samples": 150}):
                found = self.projected(job({"form": form, "order": 3, "weighting": "none", **samples}))
                np.testing.assert_allclose(found.f([10, 50], 30, 60, [0, 200]), 0.8 / math.pi, rtol=1e-5)

    def test_files_agree(self):
        projection = self.projected(job({"order": 3, "samples": 50}, GROOVE, orders="separate", max_order=2))
        self.assertEqual(projection.coefficients.shape, (3, 3, 2, 9))
        array = np.load(self.folder / "p.npy")
        for field, values in (("value", projection.coefficients), ("se", projection.standard_error), ("bias", projection.bias)):
            np.testing.assert_array_equal(array[field], values)
        self.assertTrue((projection.standard_error > 0).any())
        lines = (self.folder / "p.csv").read_text().splitlines()
        head = next(k for k, line in enumerate(lines) if not line.startswith("#"))
        self.assertEqual(lines[head], "theta_i_deg,phi_i_deg,l,m,order,c_r,se_r,bias_r,c_g,se_g,bias_g,c_b,se_b,bias_b")
        rows = np.loadtxt(lines[head + 1:], delimiter=",")
        np.testing.assert_array_equal(rows[:, 5::3].reshape(2, 9, 3, 3).transpose(3, 2, 0, 1), projection.coefficients)
        attributes, layers = read_exr(self.folder / "p.exr")
        for slice_, layer in enumerate(("", "order1.", "order2.")):
            for field, values in (("", projection.coefficients), ("se.", projection.standard_error), ("bias.", projection.bias)):
                for channel, name in enumerate("RGB"):
                    np.testing.assert_array_equal(layers[layer + field + name], values[channel, slice_].astype(np.float32))
        self.assertEqual(len(layers), 27)
        self.assertEqual(attributes["gonio.job_hash"].decode(), projection.provenance["job_hash"])
        self.assertIn("cos(theta_i)", attributes["gonio.quantity"].decode())
        trailer = (self.folder / "p.npy").read_bytes().rsplit(b"\n", 2)[-2]
        self.assertIn(projection.provenance["job_hash"].encode(), trailer)
        self.assertEqual(json.loads(trailer[trailer.index(b'{"format"'):])["shape"], [3, 3, 2, 9])

    def test_what_is_reconstructed_is_what_is_measured(self):
        measured = {"measure": {"kind": "brdf", "incident": LIGHTS, "outgoing": {"hemisphere": 200}}}
        document = job({}, EGG_CRATE) | measured | {"output": [{"format": "json", "path": "t.json"}]}
        self.run_job(document, "-q")
        table = read_table(self.folder / "t.json")
        cosines = np.cos(np.radians(table.coords["theta_o"]))
        for project in ({"samples": 200}, {}, {"form": "matrix", "samples": 100, "order": 6}):
            found = self.projected(job(project, EGG_CRATE))
            for i, theta in enumerate((0, 45)):
                expected = table.values[i, 0, :, 0] * cosines
                got = found.f(theta, 20, table.coords["theta_o"], table.coords["phi_o"]) * cosines
                error = np.sqrt(np.mean((got - expected) ** 2) / np.mean(expected ** 2))
                self.assertLess(error, 1.5 * found.relative_error.max() + 0.02, project)
                self.assertLess(error, 0.1, project)
        self.gonio("project", "t.json", "--order", "6", "-o", "q.json", "--plot", "lobes.svg", "-q")
        self.assertIn("<svg", (self.folder / "lobes.svg").read_text())
        own = read_projection(self.folder / "q.json")
        got = own.f(45, 20, table.coords["theta_o"], table.coords["phi_o"]) * cosines
        self.assertLess(np.sqrt(np.mean((got - expected) ** 2) / np.mean(expected ** 2)), own.relative_error.max())

    def test_joint_form_notices_grooves(self):
        report = json.loads(self.run_job(job({"form": "joint", "order": 3, "samples": 100}, GROOVE), "--json", "-q").stdout)["report"]
        self.assertTrue(any("isotropic" in warning for warning in report["warnings"]), report)
        self.assertGreater(report["counters"]["isotropy defect"], 0.1)
        reciprocal = self.projected(job({"form": "joint", "order": 3, "samples": 200, "isotropic": False}, GROOVE))
        self.assertEqual(reciprocal.coefficients.shape, (3, 1, 45))
        np.testing.assert_allclose(reciprocal.f(20, 10, 50, 100), reciprocal.f(50, 100, 20, 10), rtol=1e-9)
        plane = json.loads(self.run_job(job({"form": "joint", "order": 3, "samples": 100}), "--json", "-q").stdout)["report"]
        self.assertEqual(plane["warnings"], [])

    def test_same_bits(self):
        document = job({"form": "joint", "order": 4, "samples": 100}, GROOVE)
        self.run_job(document, "-q", "--threads", "1", "-o", "one")
        self.run_job(document, "-q", "--threads", "2", "-o", "two")
        for name in ("p.json", "p.csv", "p.npy"):
            self.assertEqual((self.folder / "one" / name).read_bytes(), (self.folder / "two" / name).read_bytes(), name)
        document["accuracy"]["seed"] = 2
        self.run_job(document, "-q", "-o", "three")
        self.assertNotEqual((self.folder / "one/p.json").read_bytes(), (self.folder / "three/p.json").read_bytes())

    def test_refusals(self):
        for project, words in (({"order": 0}, "order"), ({"order": 33}, "33"), ({"samples": 63}, "at least 64"),
                               ({"form": "joint", "samples": 119}, "at least 120"), ({"form": "joint", "order": 30}, "4096"),
                               ({"form": "matrix", "order": 32, "samples": 65536}, "at most")):
            with self.subTest(project):
                failed = self.run_job(job(project), code=6 if words in ("4096", "at most") else 3)
                self.assertIn(words, failed.stderr)
                self.assertIn("/measure", failed.stderr)
        self.assertEqual([path.name for path in self.folder.iterdir()], ["job.json"])
        (self.folder / "t.json").write_text("{}")
        self.gonio("project", "t.json", code=3)
        self.run_job(job({}) | {"measure": {"kind": "brdf", "incident": LIGHTS, "outgoing": {"hemisphere": 40}},
                                "output": [{"format": "csv", "path": "t.csv"}]}, "-q")
        self.assertIn("64", self.gonio("project", "t.csv", code=3).stderr)
        self.assertIn("order", self.gonio("project", "t.csv", "--order", "99", code=3).stderr)
        self.assertIn("order", self.gonio("project", "t.csv", "--order", "-1", code=3).stderr)
        self.gonio("project", "t.csv", "--order", "5", "-o", "p.tiff", code=3)
        self.gonio("project", "t.csv", "--order", "5", "-o", "p.npy")

    def test_python_harmonics(self):
        document = json.loads((SOURCE / "tests/validation/data/sh_basis.json").read_text())
        for entry in document["entries"]:
            np.testing.assert_allclose(harmonics("sh", 6, *entry["theta_phi"]), entry["values"], atol=2e-12)


if __name__ == "__main__":
    unittest.main()
