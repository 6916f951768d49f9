"""BTFs, light fields and maps: the same from a server and from the program, read as arrays."""
import json

import gonio
import numpy as np
from support import GONIO, MATERIAL, SURFACE, ServiceTest

LIGHTS = {"list_deg": [[30, 0], [60, 90]]}
BTF = {"surface": SURFACE, "material": MATERIAL, "measure": {"kind": "btf", "incident": LIGHTS, "outgoing": {"bonn": 81}},
       "accuracy": {"samples": {"directions": 16, "replicates": 2}}}


class Files(ServiceTest):
    def test_a_btf_from_both_sides(self):
        client = gonio.Client(self.service.url)
        job = client.submit(BTF).wait(120)
        self.assertEqual(job.last.info["processID"], "btf")
        factored = gonio.read_arrays(job.fetch(self.folder / "a.btf", "btf"))
        self.assertTrue(job.read("btf", "png").startswith(b"\x89PNG"))
        paths = gonio.run_files(self.folder, BTF, program=GONIO, output=[{"format": form, "path": f"b.{form}"} for form in ("images", "btf")])
        images = gonio.read_arrays(paths[0])
        self.assertEqual(images["images"].shape, (81, 2, 1, 1, 16))
        self.assertEqual(images.head["job_hash"], factored.head["job_hash"])
        for view in (0, 40, 80):
            np.testing.assert_array_equal(factored.images(view), images.images(view))
        self.assertEqual((self.folder / "a.btf").read_bytes(), paths[1].read_bytes())

    def test_images_are_saved_as_the_program_writes_them(self):
        for samples, material, forms in ((3, MATERIAL, ("btf", "images")), (1, {"model": "ggx", "alpha": 0.4, "reflectance": 0.9}, ("images",))):
            document = {**BTF, "material": material, "measure": {**BTF["measure"], "pixel_samples": samples, "outgoing": LIGHTS}}
            *paths, program = gonio.run_files(self.folder, document, program=GONIO, output=[{"format": form, "path": f"b.{form}"} for form in (*forms, "npy")])
            for path in paths:
                saved = gonio.read_arrays(path).save_images(self.folder / "saved.npy")
                np.testing.assert_array_equal(np.load(saved).view(np.uint16), np.load(program).view(np.uint16))
                np.testing.assert_array_equal(gonio.read_arrays(path).images(1), np.load(program)[1])
                said, expected = (json.loads(file.read_bytes().rsplit(b"\n", 2)[-2]) for file in (saved, program))
                self.assertEqual(said, expected)
            self.assertEqual([path.name for path in self.folder.glob(".*")], [])
        job = gonio.Client(self.service.url).submit(document).wait(120)
        np.testing.assert_array_equal(np.load(job.fetch(self.folder / "served.npy", "btf")), np.load(program))

    def test_maps_and_light_fields_of_a_server(self):
        client = gonio.Client(self.service.url)
        maps = client.submit(BTF, measure={"kind": "maps", "incident": LIGHTS}).wait(120)
        arrays = gonio.read_arrays(maps.fetch(self.folder / "a.arrays", "maps"))
        self.assertEqual(arrays["maps"].shape, (len(arrays.head["layers"]), 1, 16))
        field = client.submit(BTF, measure={"kind": "light_field", "incident": LIGHTS,
                                            "cameras": {"count": [3, 2], "width": "1 mm", "height": "5 mm"}}).wait(120)
        self.assertEqual(gonio.read_arrays(field.fetch(self.folder / "f.btf", "light_field")).images(5).shape, (2, 1, 1, 16))

    def test_an_environment_is_uploaded(self):
        sky = self.folder / "sky.hdr"
        sky.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n" + bytes(range(96, 128)) * 4)
        job = gonio.Client(self.service.url).submit(BTF, environment={"file": sky}, measure={"kind": "relight", "outgoing": LIGHTS}).wait(120)
        local = gonio.run_files(self.folder, BTF, environment={"file": sky}, measure={"kind": "relight", "outgoing": LIGHTS},
                                program=GONIO, output=[{"format": "npy", "path": "a.npy"}])
        np.testing.assert_array_equal(np.load(job.fetch(self.folder / "b.npy", "relight", "npy")), np.load(local[0]))

    def test_a_process_takes_its_own_kind(self):
        with self.assertRaises(gonio.ApiError) as caught:
            gonio.Client(self.service.url).submit(BTF, process="brdf")
        self.assertIn("/measure/kind", str(caught.exception))

    def test_what_is_no_such_file(self):
        for name, content in (("empty", b""), ("table", b"theta_i_deg,phi"), ("json", b"{}\n"), ("list", b"[1]\n"),
                              ("beyond", b'{"arrays": [{"name": "a", "dtype": "<f4", "shape": [9], "offset": 64}]}\n')):
            (self.folder / name).write_bytes(content)
            with self.subTest(name), self.assertRaises(gonio.InvalidTable):
                gonio.read_arrays(self.folder / name)
