"""Tables as arrays: axes, errors, units, selection; CSV and JSON alike."""
import json
import pathlib
import subprocess
import tempfile
import unittest

import gonio
import numpy as np
from support import GONIO, JOB

ACCURACY = {"accuracy": {"samples": {"replicates": 3}}}
GRID = {"theta_deg": [0, 30], "phi_deg": [0, 90, 200]}
LIST = {"list_deg": [[0, 0], [40, 20], [70, 300]]}
PAIRS = [[0, 0, 0, 0], [30, 0, 40, 90], [0, 0, 40, 90], [30, 0, 40, 350]]


class Tables(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="gonio_python_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def both(self, measure, **members):
        """The table that `gonio run` writes, read from JSON and CSV, and the rows of the CSV file by its header."""
        job = JOB | ACCURACY | {"measure": {"kind": "brdf", **measure}} | members
        job["output"] = [{"format": format, "path": f"table.{format}"} for format in ("json", "csv")]
        (self.folder / "job.json").write_text(json.dumps(job))
        subprocess.run([GONIO, "run", "job.json", "-q"], cwd=self.folder, check=True)
        rows = np.genfromtxt([line for line in (self.folder / "table.csv").read_text().splitlines() if line[0] != "#"],
                             delimiter=",", names=True, dtype=None)
        one, other = (gonio.read_table(self.folder / f"table.{format}") for format in ("json", "csv"))
        self.assertEqual((one.dims, one.units, one.provenance), (other.dims, other.units, other.provenance))
        for name in ("values", "standard_error", "bias"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        self.assertEqual(list(one.coords), list(other.coords))
        for name, values in one.coords.items():
            np.testing.assert_array_equal(values, other.coords[name])
        return one, np.atleast_1d(rows)

    def test_grid(self):
        table, rows = self.both({"incident": GRID, "outgoing": {"theta_deg": [10, 50], "phi_deg": [45]}})
        self.assertEqual(table.dims, ("theta_i", "phi_i", "theta_o", "phi_o", "channel"))
        self.assertEqual(table.shape, (2, 3, 2, 1, 1))
        np.testing.assert_array_equal(table.coords["phi_i"], [0, 90, 200])
        np.testing.assert_array_equal(table.values.ravel(), rows["f_y"].astype(np.float32))
        np.testing.assert_array_equal(table.standard_error.ravel(), rows["se_y"].astype(np.float32))
        np.testing.assert_array_equal(table.bias.ravel(), rows["bias_y"].astype(np.float32))
        np.testing.assert_allclose(table.error, np.sqrt(table.standard_error**2 + table.bias**2), rtol=1e-6)
        self.assertEqual((table.units["values"], table.units["theta_i"]), ("1/sr", "deg"))
        self.assertEqual(table.provenance["seed"], "1")

    def test_cells(self):
        table, rows = self.both({"incident": LIST, "outgoing": {"cells": {"equal": 5}}},
                                material={"model": "mirror", "reflectance": 0.5})
        self.assertEqual(table.dims, ("incident", "outgoing", "channel"))
        np.testing.assert_array_equal(table.coords["theta_o_max"], rows["theta_o_max_deg"][:5])
        np.testing.assert_allclose(table.coords["projected_solid_angle_o"], np.pi / 5, rtol=1e-12)
        self.assertEqual((table.units["phi_o_min"], table.units["solid_angle_o"]), ("deg", "sr"))
        leaving = table.values[:, :, 0] @ table.coords["projected_solid_angle_o"]
        self.assertTrue(((leaving > 0.2) & (leaving <= 0.5 + 1e-6)).all(), leaving)
        self.assertNotIn("theta_o_min", table.sel(theta_o=10, phi_o=0).coords)

    def test_lists_orders_and_channels(self):
        table, rows = self.both({"incident": LIST, "outgoing": GRID, "orders": "separate", "max_order": 2},
                                material={"model": "lambertian", "albedo": [0.2, 0.4, 0.8]})
        self.assertEqual(table.dims, ("incident", "theta_o", "phi_o", "channel", "order"))
        self.assertEqual(table.shape, (3, 2, 3, 3, 3))
        np.testing.assert_array_equal(table.coords["phi_i"], [0, 20, 300])
        self.assertEqual(list(table.coords["channel"]), ["r", "g", "b"])
        for row in rows:
            part = table.sel(theta_i=row["theta_i_deg"], phi_i=row["phi_i_deg"], theta_o=row["theta_o_deg"],
                             phi_o=row["phi_o_deg"], order=row["order"])
            self.assertEqual(part.dims, ("channel",))
            np.testing.assert_array_equal(part.values, np.float32([row["f_r"], row["f_g"], row["f_b"]]))
            np.testing.assert_array_equal(part.bias, np.float32([row["bias_r"], row["bias_g"], row["bias_b"]]))

    def test_pairs(self):
        table, rows = self.both({"pairs_deg": PAIRS})
        self.assertEqual((table.dims, table.shape), (("pair", "channel"), (4, 1)))
        angles = [table.coords[name] for name in ("theta_i", "phi_i", "theta_o", "phi_o")]
        np.testing.assert_array_equal(np.stack(angles, 1), PAIRS)
        np.testing.assert_array_equal(table.values[:, 0], rows["f_y"].astype(np.float32))
        # 356 degrees is nearest to 350, around the circle.
        near = table.sel(theta_i=29, phi_i=1, theta_o=41, phi_o=356, channel="y")
        self.assertEqual((near.dims, near.values), ((), table.values[3, 0]))

    def test_sel(self):
        table, _ = self.both({"incident": GRID, "outgoing": LIST})
        part = table.sel(theta_i=17, phi_i=340)
        np.testing.assert_array_equal(part.values, table.values[1, 0])
        self.assertEqual((part.dims, sorted(part.coords)), (("outgoing", "channel"), ["channel", "phi_o", "theta_o"]))
        # Near the pole phi says little: (1, 180) lies by (0, 0).
        np.testing.assert_array_equal(table.sel(theta_o=1, phi_o=180).values, table.values[:, :, 0])
        for wrong in ({"theta_o": 3}, {"channel": "r"}, {"order": 0}, {"thetai": 3}):
            with self.assertRaises(KeyError):
                table.sel(**wrong)

    def test_what_is_no_table(self):
        table, _ = self.both({"incident": GRID, "outgoing": GRID})
        text = (self.folder / "table.json").read_text()
        rows = (self.folder / "table.csv").read_text().splitlines(keepends=True)
        bad = ["", "[]", "{}", text[:-9], text.replace('"version":1', '"version":2'), text.replace("gonio-table", "x"),
               text.replace('"pairs":null', '"pairs":[[0,9]]'), text.replace('"values": [', '"values": [1,'),
               "".join(rows[:-1]) + rows[-1][:9], "".join(rows[:8]), "".join(rows).replace("version 1", "version 2"),
               "".join(rows).replace("f_y", "g_y"), "".join(rows)[1:]]
        for content in bad:
            (self.folder / "bad").write_text(content)
            with self.subTest(content[:60]), self.assertRaises(gonio.InvalidTable):
                gonio.read_table(self.folder / "bad")
        with self.assertRaises(gonio.InvalidTable):
            gonio.read_table(self.folder / "none")
        (self.folder / "bad").write_bytes(b"# gonio table, version 1\n\xff\n")
        with self.assertRaises(gonio.InvalidTable):
            gonio.read_table(self.folder / "bad")
