#!/usr/bin/env python3
"""BTFs, light fields and maps as files: both forms of a BTF, what a stranger's reader finds, and what is left when a job is stopped.

Usage: pictures_test.py GONIO SOURCE_FOLDER [unittest options]
"""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import numpy as np
from read_exr import read_exr

GONIO = os.path.abspath(sys.argv.pop(1))
SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()
RELIEF = {"generate": "gaussian", "samples": 48, "pitch": "1 um", "correlation_length": "8 um", "rms_slope": 0.7}
FEW = {"samples": {"directions": 16, "replicates": 2}}


def job(measure, albedo=0.8, surface=None, accuracy=None, **sections):
    return {"surface": surface or RELIEF, "material": {"model": "lambertian", "albedo": albedo}, "measure": measure,
            "accuracy": accuracy or FEW, **sections}


def btf(**members):
    return {"kind": "btf", "incident": {"bonn": 81}, "outgoing": {"theta_deg": [0, 50], "phi_deg": [0, 130]}, **members}


def read(path):
    """The ten lines of server/README.md."""
    with open(path, "rb") as file:
        head = json.loads(file.readline())
    return head, {a["name"]: np.memmap(path, a["dtype"], "r", a["offset"], tuple(a["shape"])) for a in head["arrays"]}


def read_npy(path):
    """Its array, and what its last line says."""
    array = np.load(path, mmap_mode="r")
    with open(path, "rb") as file:
        file.seek(array.offset + array.nbytes)
        return array, json.load(file)


class Pictures(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio_pictures_"))
        self.addCleanup(shutil.rmtree, self.folder)

    def gonio(self, *arguments, code=0):
        result = subprocess.run([GONIO, *map(str, arguments)], cwd=self.folder, capture_output=True, text=True, timeout=300)
        self.assertEqual(result.returncode, code, result.stderr)
        return result

    def run_job(self, document, *options, code=0):
        path = self.folder / "job.json"
        path.write_text(json.dumps(document))
        return self.gonio("run", path, "-q", *options, code=code)

    def left(self):
        return sorted(p.name for p in self.folder.iterdir() if p.name != "job.json")

    def test_expanding_gives_the_images_to_the_last_bit(self):
        for members, albedo in (({}, 0.8), ({"pixels": [20, 36], "pixel_samples": 3, "plane": "zero"}, [0.9, 0.5, 0.1])):
            outputs = [{"format": name, "path": f"a.{name}"} for name in ("btf", "images", "npy", "png", "csv")]
            self.run_job(job(btf(**members), albedo, output=outputs))
            self.gonio("expand", "a.btf", "-o", "b.images", "-q")
            self.assertEqual((self.folder / "a.images").read_bytes(), (self.folder / "b.images").read_bytes())
            self.gonio("expand", "a.btf", "-o", "b.npy", "-q")
            self.gonio("expand", "a.btf", "-q")
            self.assertEqual((self.folder / "a.images").read_bytes(), (self.folder / "b.images").read_bytes())

            head, arrays = read(self.folder / "a.images")
            factored_head, factored = read(self.folder / "a.btf")
            nx, ny = members.get("pixels", [48, 48])
            self.assertEqual(arrays["images"].shape, (4, 81, 1 if albedo == 0.8 else 3, ny, nx))
            self.assertEqual(head["job_hash"], factored_head["job_hash"])
            if not members:  # four views of few pixels hardly share anything
                self.assertLess(len((self.folder / "a.btf").read_bytes()), 0.6 * len((self.folder / "a.images").read_bytes()))
            # For NumPy: the same halves, and the same words and small arrays behind them.
            self.assertEqual((self.folder / "a.npy").read_bytes(), (self.folder / "b.npy").read_bytes())
            self.check_npy("a.npy", "a.images")
            # The factored form as anyone would read it.
            maps = factored["view_maps"]
            values = np.asarray(factored["facet_radiance"], np.float32)[:, :, maps[2]].mean(axis=2).swapaxes(0, 1)
            np.testing.assert_allclose(np.asarray(arrays["images"][2], np.float32), values, rtol=1e-3, atol=1e-6)
            # The stated means are those of the images, and the table's.
            means = np.asarray(arrays["images"], np.float64).mean(axis=(3, 4))
            np.testing.assert_allclose(arrays["mean"], means.transpose(2, 1, 0), rtol=2e-3)
            rows = [line for line in (self.folder / "a.csv").read_text().splitlines() if not line.startswith("#")]
            self.assertEqual(len(rows), 1 + 81 * 4)
            self.assertTrue((arrays["mean_se"] >= 0).all() and (arrays["pixel_se"] > 0).all())
            self.assertTrue((self.folder / "a.png").read_bytes().startswith(b"\x89PNG"))

    def check_npy(self, npy, images):
        """Bit by bit, also of what the numbers are."""
        head, arrays = read(self.folder / images)
        array, said = read_npy(self.folder / npy)
        self.assertEqual(array.dtype, np.dtype("<f2"))
        np.testing.assert_array_equal(array.view(np.uint16), arrays["images"].view(np.uint16))
        for name in ("mean", "mean_se", "mean_bias", "pixel_se"):
            np.testing.assert_array_equal(np.asarray(said.pop(name), np.float32), arrays[name])
        self.assertEqual(said.pop("axes"), ["view", "light", "channel", "row", "column"])
        self.assertEqual(said.pop("mean_axes"), ["channel", "light", "view"])
        self.assertEqual(said, {name: value for name, value in head.items() if name != "arrays"})

    def test_a_batch_finds_a_long_npy(self):
        # Its provenance stands behind the numbers.
        document = job(btf(outgoing={"theta_deg": [0, 60], "phi_deg": [0, 90, 180, 270]}), output=[{"format": "npy", "path": "a.npy"}])
        (self.folder / "jobs").mkdir()
        (self.folder / "jobs/a.json").write_text(json.dumps(document))
        self.gonio("batch", "jobs", "-o", self.folder)
        self.assertGreater((self.folder / "a.npy").stat().st_size, 2 << 20)
        self.assertIn("a.json: skipped", self.gonio("batch", "jobs", "-o", self.folder).stderr)
        document["accuracy"] = {"samples": {"directions": 17, "replicates": 2}}
        (self.folder / "jobs/a.json").write_text(json.dumps(document))
        self.assertIn("a.json: done", self.gonio("batch", "jobs", "-o", self.folder).stderr)

    def test_light_field_of_far_cameras_is_that_of_directions(self):
        # Cameras above the middle at a great height see the pixels from straight above.
        cameras = {"count": [2, 1], "width": "1 um", "height": "1 km"}
        lights = {"list_deg": [[30, 0], [50, 200]]}
        self.run_job(job({"kind": "light_field", "incident": lights, "cameras": cameras, "pixel_samples": 2}, output=[{"format": "images", "path": "near"}]))
        self.run_job(job({"kind": "light_field", "incident": lights, "outgoing": {"list_deg": [[0, 0]]}, "pixel_samples": 2}, output=[{"format": "images", "path": "far"}]))
        near_head, near = read(self.folder / "near")
        far_head, far = read(self.folder / "far")
        self.assertEqual(near_head["cameras"], [2, 1])
        self.assertEqual(len(near_head["cameras_m"]), 2)
        self.assertEqual(far_head["content"], "light field")
        for camera in range(2):
            same = near["images"][camera] == far["images"][0]
            self.assertGreater(same.mean(), 0.99)

    def test_light_field_under_an_environment(self):
        for name, view in (("sky", {"outgoing": {"list_deg": [[0, 0], [50, 20]]}}), ("near", {"cameras": {"count": [2, 1], "width": "20 um", "height": "60 um"}})):
            document = job({"kind": "light_field", "pixels": [24, 24], "pixel_samples": 4, **view}, 1, environment={"radiance": 3},
                           accuracy={"samples": {"directions": 64, "replicates": 4}}, output=[{"format": form, "path": f"{name}.{form}"} for form in ("btf", "images", "npy", "png")])
            self.run_job(document)
            head, arrays = read(self.folder / f"{name}.btf")
            self.assertAlmostEqual(head["irradiance"][0], 3 * np.pi, places=5)
            self.assertNotIn("incident_deg", head)
            # A white relief under a uniform sky is as bright as the sky.
            self.assertEqual(arrays["mean"].shape, (1, 1, 2))
            np.testing.assert_allclose(head["irradiance"][0] * arrays["mean"], 3, rtol=0.01)
            self.gonio("expand", f"{name}.btf", "-o", "expanded")
            self.assertEqual((self.folder / "expanded").read_bytes(), (self.folder / f"{name}.images").read_bytes())
            self.check_npy(f"{name}.npy", f"{name}.images")
            self.assertTrue((self.folder / f"{name}.png").read_bytes().startswith(b"\x89PNG"))
        self.assertIn("/base", self.run_job({**document, "base": {"kappa_1": 10}}, code=3).stderr)
        document["material"] = {"model": "ggx", "alpha": 0.4, "reflectance": 1}
        self.run_job({**document, "output": [{"format": form, "path": f"glossy{ending}"} for form, ending in (("images", ""), ("npy", ".npy"), ("png", ".png"))]})
        self.check_npy("glossy.npy", "glossy")
        head, arrays = read(self.folder / "glossy")
        self.assertEqual(arrays["images"].shape, (2, 1, 1, 24, 24))
        self.run_job({**document, "measure": {"kind": "relight", "outgoing": {"list_deg": [[0, 0]]}}, "output": [{"format": "json", "path": "whole"}]})
        whole = json.loads((self.folder / "whole").read_text())["mean"][0][0]
        self.assertLess(whole, 3)  # single scattering on rough facets loses some of the light
        # Cameras 20 um apart 60 um above see about what is seen from straight above.
        np.testing.assert_allclose(head["irradiance"][0] * arrays["mean"], whole, rtol=0.03)
        np.testing.assert_allclose(arrays["images"].astype(float).mean(axis=(2, 3, 4)).ravel(), arrays["mean"].ravel(), rtol=2e-3)

    def test_light_field_of_a_near_camera_has_perspective(self):
        # A plane of two albedos seen from the height of half its width: what is seen at a pixel of its own plane is that pixel.
        grid = [[0] * 32 for _ in range(32)]
        surface = {"grid": grid, "pitch": "1 mm", "height_scale": "1 mm"}
        albedo = self.folder / "albedo.txt"
        albedo.write_text("\n".join(" ".join("0.2" if (i // 4 + j // 4) % 2 else "0.9" for i in range(32)) for j in range(32)))
        cameras = {"count": [3, 3], "width": "40 mm", "height": "16 mm"}
        self.run_job(job({"kind": "light_field", "incident": {"list_deg": [[0, 0]]}, "cameras": cameras}, {"file": "albedo.txt"}, surface,
                         output=[{"format": "images", "path": "a"}]))
        images = np.asarray(read(self.folder / "a")[1]["images"], np.float64)
        expected = np.array([[0.2 if (i // 4 + j // 4) % 2 else 0.9 for i in range(32)] for j in range(32)]) / np.pi
        for camera in range(9):
            np.testing.assert_allclose(images[camera, 0, 0], expected, rtol=2e-3)

    def test_maps(self):
        outputs = [{"format": name, "path": f"a.{name}"} for name in ("arrays", "exr", "png", "npy", "json")]
        self.run_job(job({"kind": "maps", "incident": {"list_deg": [[20, 0], [70, 90]]}, "outgoing": {"list_deg": [[60, 10]]}}, output=outputs))
        head, arrays = read(self.folder / "a.arrays")
        layer = dict(zip(head["layers"], arrays["maps"]))
        self.assertEqual(head["layers"][:4], ["light000.direct.y", "light000.indirect.y", "light000.total.y", "light000.shadow"])
        np.testing.assert_allclose(layer["light001.direct.y"] + layer["light001.indirect.y"], layer["light001.total.y"], rtol=1e-5)
        for name in ("light000.shadow", "light001.shadow", "view000.mask", "sky"):
            self.assertGreaterEqual(layer[name].min(), 0)
            self.assertLessEqual(layer[name].max(), 1.03)
        self.assertGreater(layer["light000.shadow"].mean(), layer["light001.shadow"].mean() + 0.1)
        np.testing.assert_array_equal(np.load(self.folder / "a.npy"), arrays["maps"])
        said = json.loads((self.folder / "a.json").read_text())
        self.assertEqual(said, {name: value for name, value in head.items() if name != "arrays"})
        self.assertEqual(said, json.loads((self.folder / "a.npy").read_bytes().rsplit(b"\n", 2)[-2]))
        np.testing.assert_allclose(said["mean"], arrays["maps"].mean(axis=(1, 2)), rtol=1e-5)
        attributes, channels = read_exr(self.folder / "a.exr")
        self.assertEqual(attributes["gonio.job_hash"].decode(), head["job_hash"])
        self.assertEqual(len(channels), len(layer))
        np.testing.assert_array_equal(channels["light001.total.Y"][::-1], layer["light001.total.y"])
        np.testing.assert_array_equal(channels["view000.mask.Y"][::-1], layer["view000.mask"])

    def test_examples(self):
        for name in ("lava_btf", "light_field", "lava_maps"):
            self.gonio("run", SOURCE / f"clients/examples/{name}.json", "--dry-run")

    def test_glossy_facets_have_images_and_no_factored_form(self):
        ggx = {"model": "ggx", "alpha": 0.3, "reflectance": 0.9}
        pictures = btf(incident={"theta_deg": [0, 40], "phi_deg": [0, 90]})
        refused = self.run_job({**job(pictures, output=[{"format": "btf", "path": "a.btf"}]), "material": ggx}, code=3)
        self.assertIn("images", refused.stderr)
        self.assertEqual(self.left(), [])
        outputs = [{"format": name, "path": f"a.{name}"} for name in ("npy", "images", "png", "json")]
        for kind in (pictures, {**{k: v for k, v in pictures.items() if k != "outgoing"}, "kind": "light_field",
                                "cameras": {"count": [2, 1], "width": "20 um", "height": "40 um"}}):
            self.run_job({**job(kind, output=outputs[:3 if "cameras" in kind else 4]), "material": ggx})
            self.check_npy("a.npy", "a.images")
            head, arrays = read(self.folder / "a.images")
            self.assertEqual(head["transport"], "pair graph")
            images = np.asarray(arrays["images"], np.float64)
            self.assertEqual(images.shape[1:], (4, 1, 48, 48))
            means = images.mean(axis=(3, 4)).transpose(2, 1, 0)
            np.testing.assert_allclose(arrays["mean"], means, rtol=1e-3)

    def test_what_cannot_be_expanded(self):
        self.run_job(job(btf(), output=[{"format": "btf", "path": "a.btf"}, {"format": "images", "path": "a.images"}]))
        whole = (self.folder / "a.btf").read_bytes()
        end = whole.index(b"\n")
        self.gonio("expand", "none.btf", code=3)
        self.gonio("expand", "a.images", "-o", "b", code=3)
        for name, content in (("cut", whole[:-1]), ("headless", whole[end:]), ("empty", b""), ("json", b"{}\n"), ("no_line", b"{" * 9000),
                              ("other", whole.replace(b'"gonio btf"', b'"gonio btg"', 1)),
                              ("facets", whole[:-4] + b"\xff\xff\xff\xff"),
                              ("shape", whole.replace(b'"n_views":4', b'"n_views":5', 1))):
            (self.folder / name).write_bytes(content)
            result = self.gonio("expand", name, "-o", "b", code=3)
            self.assertIn(name, result.stderr)
        self.assertFalse((self.folder / "b").exists())

    def test_a_stopped_job_leaves_nothing(self):
        endless = dict(RELIEF, samples=256)
        document = job(btf(outgoing={"bonn": 151}), surface=endless, accuracy={"target_relative_error": 1e-6},
                       output=[{"format": "images", "path": "a.images"}])
        path = self.folder / "job.json"
        path.write_text(json.dumps(document))
        process = subprocess.Popen([GONIO, "run", path, "-o", self.folder], stderr=subprocess.DEVNULL)
        time.sleep(1.5)
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(30), 130)
        self.assertEqual(self.left(), [])

    def test_no_part_of_a_streamed_file_has_its_name(self):
        # Glossy pictures are written while they are computed: stopped, or killed, in the midst of that.
        document = {**job(btf(outgoing={"bonn": 81}), surface=dict(RELIEF, samples=96), accuracy={"samples": {"directions": 64, "replicates": 2}},
                          output=[{"format": "npy", "path": "a.npy"}, {"format": "images", "path": "a.images"}]),
                    "material": {"model": "ggx", "alpha": 0.3, "reflectance": 0.9}}
        path = self.folder / "job.json"
        path.write_text(json.dumps(document))
        for sent, code in ((signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)):
            process = subprocess.Popen([GONIO, "run", path, "-o", self.folder], stderr=subprocess.DEVNULL)
            deadline = time.monotonic() + 60
            while not any(p.name.startswith(".a.npy") and p.stat().st_size > 4 << 20 for p in self.folder.iterdir()):
                self.assertIsNone(process.poll())
                self.assertLess(time.monotonic(), deadline)
                time.sleep(0.02)
            process.send_signal(sent)
            self.assertEqual(process.wait(30), code)
            left = self.left()
            self.assertEqual(left if sent == signal.SIGINT else [name for name in left if not name.endswith(".tmp")], [])

    def test_a_full_disk_is_an_error(self):
        for material in (job({})["material"], {"model": "ggx", "alpha": 0.3, "reflectance": 0.9}):
            result = self.run_job({**job(btf(outgoing={"list_deg": [[0, 0]]}), output=[{"format": "npy", "path": "/dev/full"}]), "material": material}, code=1)
            self.assertIn("/dev/full", result.stderr)

    def test_shards_and_the_path_tracer_are_for_tables(self):
        (self.folder / "job.json").write_text(json.dumps(job(btf())))
        self.gonio("shard", "--job", "job.json", "--index", 0, "--checkpoints", "work", code=3)
        self.gonio("reference", "job.json", code=3)


if __name__ == "__main__":
    unittest.main()
