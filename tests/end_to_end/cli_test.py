#!/usr/bin/env python3
"""The program as people and scripts meet it: exit codes, messages, files, interruption.

Usage: cli_test.py GONIO SOURCE_FOLDER [unittest options]
"""
import json
import os
import pathlib
import pty
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

GONIO = os.path.abspath(sys.argv.pop(1))
SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()
LAVA = str(SOURCE / "tests/samples/lava_rock_256_16bit.png")
COMMANDS = ["measure", "run", "batch", "expand", "info", "reference", "shard", "merge", "dispatch", "project", "plot", "ndf", "schema", "serve",
            "submit", "status", "wait", "fetch", "cancel", "list", "store", "completions"]

# A flat plane is answered exactly and at once; a V-groove needs the engine.
PLANE = {"generate": "plane", "samples": 2, "pitch": "1 mm"}
GROOVE = {"generate": "v_groove", "samples": 16, "period": "1mm", "slope_deg": 45}
# Minutes of work: nothing may finish it but Ctrl-C.
ENDLESS_SURFACE = {"generate": "gaussian", "samples": 512, "pitch": "1 um", "correlation_length": "4 um", "rms_slope": 1}


def job(surface=None, albedo=0.5, **sections):
    document = {
        "surface": surface or PLANE,
        "material": {"model": "lambertian", "albedo": albedo},
        "measure": {
            "kind": "brdf",
            "incident": {"theta_deg": [0, 45], "phi_deg": [0]},
            "outgoing": {"theta_deg": [0, 30], "phi_deg": [0, 180]},
        },
    }
    document.update(sections)
    return document


def endless_job(path):
    klems = {"klems": "full"}
    return job(ENDLESS_SURFACE, 0.9, measure={"kind": "brdf", "incident": klems, "outgoing": klems},
               accuracy={"target_relative_error": 1e-6}, output=[{"format": "csv", "path": path}])


class Program(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio_cli_"))
        self.addCleanup(shutil.rmtree, self.folder)

    def gonio(self, *arguments, code=0, stdin=None, env=None):
        result = subprocess.run([GONIO, *map(str, arguments)], cwd=self.folder, capture_output=True, text=True,
                                input=stdin, timeout=300, env={**os.environ, **(env or {})})
        self.assertEqual(result.returncode, code, result.stderr)
        return result

    def write(self, name, document):
        path = self.folder / name
        path.write_text(document if isinstance(document, str) else json.dumps(document))
        return path

    def files(self):
        return sorted(str(p.relative_to(self.folder)) for p in self.folder.rglob("*") if p.is_file())


class Help(Program):
    def test_teaches_by_example(self):
        text = self.gonio("--help").stdout
        self.assertLess(text.index("Examples:"), text.index("Options:"))
        for command in COMMANDS:
            with self.subTest(command):
                self.assertRegex(text, rf"(?m)^  {command} ")
                page = self.gonio(command, "--help").stdout
                self.assertLess(page.index("Examples:"), page.index("Options:"))
                self.assertIn(f"  gonio {command}", page)

    def test_version(self):
        self.assertRegex(self.gonio("--version").stdout, r"^gonio \d+\.\d+\.\d+\n$")

    def test_schema_is_the_file(self):
        self.assertEqual(self.gonio("schema").stdout, (SOURCE / "server/job_schema.json").read_text())

    def test_wrong_usage(self):
        self.assertIn("subcommand is required", self.gonio(code=2).stderr)
        self.assertIn('"mesure" is none of measure, run', self.gonio("mesure", code=2).stderr)
        self.assertIn("see gonio measure --help", self.gonio("measure", LAVA, "--widht", "5mm", code=2).stderr)
        self.assertIn("--threads", self.gonio("run", "x.json", "--threads", "0", code=2).stderr)
        self.gonio("run", code=2)
        self.gonio("measure", LAVA, "--incident", "klems", "--incident-phi", "0", code=2)


class Run(Program):
    def test_writes_outputs_and_reports(self):
        self.write("a.json", job(GROOVE, output=[{"format": f} for f in ("csv", "json", "exr")]))
        result = self.gonio("run", "a.json", "-o", "results/deep", "--json")
        self.assertEqual(self.files(), ["a.json", "results/deep/a.csv", "results/deep/a.exr", "results/deep/a.json"])
        answer = json.loads(result.stdout)
        self.assertEqual(answer["status"], "done")
        self.assertEqual([o["path"] for o in answer["outputs"]], [f"results/deep/a.{f}" for f in ("csv", "json", "exr")])
        self.assertTrue(answer["report"]["target_met"])
        self.assertEqual(answer["surface"]["nx"], 16)
        csv = (self.folder / "results/deep/a.csv").read_text()
        self.assertIn(answer["job_hash"], csv)
        self.assertIn(answer["surface"]["surface_hash"], csv)
        for word in ("rms", "steepest", "wrap jump", "relative error", "wrote results/deep/a.csv"):
            self.assertIn(word, result.stderr)

    def test_plane_is_exact(self):
        self.write("a.json", job(albedo=0.5))
        self.assertEqual(self.gonio("run", "a.json").stdout, "")
        rows = [line for line in (self.folder / "a.csv").read_text().splitlines() if not line.startswith("#")]
        self.assertEqual(rows[0], "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,f_y,se_y,bias_y")
        self.assertEqual(len(rows), 1 + 8)
        for row in rows[1:]:
            self.assertAlmostEqual(float(row.split(",")[4]), 0.5 / 3.141592653589793, places=6)

    def test_job_from_stdin(self):
        self.gonio("run", "-", "--quiet", stdin=json.dumps(job()))
        self.assertEqual(self.files(), ["gonio.csv"])

    def test_quiet_says_nothing(self):
        self.write("a.json", job())
        result = self.gonio("run", "a.json", "--quiet")
        self.assertEqual((result.stdout, result.stderr), ("", ""))

    def test_dry_run_writes_nothing(self):
        self.write("a.json", job(GROOVE))
        answer = json.loads(self.gonio("run", "a.json", "--dry-run").stdout)
        self.assertEqual(answer["status"], "planned")
        self.assertGreater(answer["prediction"]["cpu_seconds"], 0)
        self.assertEqual(answer["job"]["measure"]["accuracy"], {"seed": 1, "target_relative_error": 0.01})
        self.assertEqual(self.files(), ["a.json"])
        done = json.loads(self.gonio("run", "a.json", "--json").stdout)
        self.assertEqual(done["job_hash"], answer["job_hash"])

    def test_threads_do_not_change_a_bit(self):
        self.write("a.json", job(GROOVE, accuracy={"samples": {"replicates": 2}}))
        self.gonio("run", "a.json", "--threads", 1, "-o", "one")
        self.gonio("run", "a.json", "--threads", 2, "-o", "two")
        self.assertEqual((self.folder / "one/a.csv").read_bytes(), (self.folder / "two/a.csv").read_bytes())

    def test_no_skip_does_not_change_the_answer(self):
        self.write("a.json", job(GROOVE, accuracy={"samples": {"replicates": 4}}))
        self.gonio("run", "a.json", "-o", "skip")
        self.gonio("run", "a.json", "-o", "all", "--no-skip")

        def values(folder):
            rows = [line for line in (self.folder / folder / "a.csv").read_text().splitlines() if line[0].isdigit()]
            return [[float(x) for x in row.split(",")] for row in rows]

        for a, b in zip(values("skip"), values("all"), strict=True):
            self.assertEqual(a[:4], b[:4])
            self.assertLess(abs(a[4] - b[4]), 4 * (a[5] + b[5] + a[6] + b[6]) + 1e-5)

    def test_invalid_input(self):
        def fails(name, document, *words, code=3):
            self.write("a.json", document)
            result = self.gonio("run", "a.json", "--json", code=code)
            answer = json.loads(result.stdout)
            self.assertEqual(answer["status"], "failed")
            with self.subTest(name):
                for word in words:
                    self.assertIn(word, result.stderr)
                self.assertTrue(result.stderr.startswith("gonio: error: "), result.stderr)
                self.assertEqual(self.files(), ["a.json"])
            return answer

        fails("not JSON", "{", "not JSON", "line 1")
        fails("unknown key", job({"file": LAVA, "widht": "5 mm"}), '/surface/widht', 'did you mean "width"?')
        answer = fails("no unit", job({"file": LAVA, "width": 50, "height_range": "5 mm"}), "/surface/width = 50", "mm")
        self.assertEqual((answer["code"], answer["field"], answer["value"]), ("missing_unit", "/surface/width", "50"))
        fails("a unit that the file lacks", job({"file": LAVA, "width": "50 mm"}), "/surface/height_")
        fails("no such file", job({"file": "nowhere.png", "width": "5 mm", "height_range": "1 mm"}), "nowhere.png: ", "no such file")
        fails("key written twice", '{"surface": {}, "surface": {}}', "/surface", "twice")
        fails("deep", "[" * 100000, "nested")
        everything = {"hemisphere": 1 << 20}
        fails("too many pairs", job(measure={"kind": "brdf", "incident": everything, "outgoing": everything}), "at most", code=6)
        self.assertIn("no such file", self.gonio("run", "b.json", code=3).stderr)
        self.assertIn("is a folder", self.gonio("run", ".", code=3).stderr)

    def test_unwritable_output(self):
        self.write("a.json", job())
        self.write("blocked", "a file where a folder should be")
        self.assertIn("blocked", self.gonio("run", "a.json", "-o", "blocked/x", code=1).stderr)

    def test_memory_limit(self):
        klems = {"klems": "full"}
        self.write("a.json", job({**ENDLESS_SURFACE, "samples": 2048}, measure={"kind": "brdf", "incident": klems, "outgoing": klems}))
        self.gonio("run", "a.json", "--max-memory", "0.01", code=6)
        self.assertEqual(self.files(), ["a.json"])

    def test_examples_run(self):
        examples = sorted((SOURCE / "clients/examples").glob("*.json"))
        self.assertGreater(len(examples), 4)
        for path in examples:
            with self.subTest(path.name):
                answer = json.loads(self.gonio("run", path, "-o", "out", "--json").stdout)
                self.assertTrue(answer["report"]["target_met"], answer["report"])
                for output in answer["outputs"]:
                    self.assertTrue((self.folder / output["path"]).stat().st_size > 0)


class Measure(Program):
    SMALL = ["--incident-theta", "0,45", "--outgoing-theta", "0,30", "--outgoing-phi", "0,180"]
    GROOVE = ["--generate", "v_groove", "--samples", "16", "--period", "1mm", "--slope-deg", "45"]

    def test_is_a_job(self):
        document = self.gonio("measure", *self.GROOVE, *self.SMALL, "--albedo", "0.8", "--print-job").stdout
        self.write("a.json", document)
        self.assertEqual(json.loads(document)["surface"], GROOVE)
        by_job = json.loads(self.gonio("run", "a.json", "--dry-run", "--quiet").stdout)
        by_options = json.loads(self.gonio("measure", *self.GROOVE, *self.SMALL, "--albedo", "0.8", "--dry-run", "--quiet").stdout)
        self.assertEqual(by_job["job_hash"], by_options["job_hash"])
        self.assertEqual(by_job["job"]["measure"]["outgoing"], [[0, 0], [0, 180], [30, 0], [30, 180]])

    def test_takes_a_material(self):
        ggx = '{"model": "ggx", "alpha": 0.3, "metal": "Cu"}'
        self.write("copper.json", ggx)
        jobs = [json.loads(self.gonio("measure", *self.GROOVE, *self.SMALL, "--material", material, "--print-job").stdout)
                for material in (ggx, "copper.json")]
        self.assertEqual(jobs[0]["material"], json.loads(ggx))
        self.assertEqual(jobs[0], jobs[1])
        too_rough = '{"model": "ggx", "alpha": 2, "reflectance": 1}'
        self.assertIn("/material/alpha",
                      self.gonio("measure", *self.GROOVE, *self.SMALL, "--material", too_rough, code=3).stderr)
        self.gonio("measure", *self.GROOVE, "--material", ggx, "--albedo", "0.5", code=2)

    def test_writes_by_extension(self):
        self.gonio("measure", *self.GROOVE, *self.SMALL, "-o", "x/t.csv", "-o", "t.exr", "-q")
        self.assertEqual(self.files(), ["t.exr", "x/t.csv"])
        self.gonio("measure", *self.GROOVE, *self.SMALL, "-q")
        self.assertIn("v_groove.csv", self.files())
        self.assertIn("--output", self.gonio("measure", *self.GROOVE, "-o", "t.xls", code=3).stderr)

    def test_real_surface(self):
        answer = json.loads(self.gonio("measure", LAVA, "--width", "50mm", "--height-range", "5mm", "--albedo", "0.8,0.5,0.2",
                                       "--crop", "0,0,64,64", "--boundary", "mirror", *self.SMALL, "--target-error", "0.05",
                                       "--json").stdout)
        self.assertEqual(answer["surface"]["nx"], 128)
        self.assertLessEqual(answer["report"]["relative_error"], 0.05)
        self.assertIn("f_r,se_r,bias_r,f_g", (self.folder / "lava_rock_256_16bit.csv").read_text())

    def test_errors_name_the_flag(self):
        base = ["measure", LAVA, "--width", "50mm", "--height-range", "5mm"]
        for arguments, word in [
            (["measure", LAVA, "--height-range", "5mm"], "--width"),
            (["measure", LAVA, "--height-range", "5mm", "--width", "50"], '--width = "50"'),
            ([*base, "--incident", "hemisphere:0"], "--incident = 0"),
            ([*base, "--incident-theta", "0,95"], "--incident-theta = 95"),
            ([*base, "--outgoing-phi", "x"], "--outgoing-phi"),
            ([*base, "--albedo", "1.5"], "--albedo = 1.5"),
            ([*base, "--target-error", "2"], "--target-error = 2"),
            ([*base, "--boundary", "tile"], "--boundary"),
            ([*base, "--crop", "0,0,999,9"], "--crop"),
            (["measure"], "SURFACE"),
        ]:
            with self.subTest(word):
                self.assertIn(word, self.gonio(*arguments, code=3).stderr)


class Batch(Program):
    def test_skips_goes_on_and_sums_up(self):
        lines = [json.dumps(job(albedo=a, output=[{"format": "csv", "path": f"{a}.csv"}])) for a in (0.1, 0.2)]
        lines.insert(1, json.dumps(job(albedo=2)))
        lines.append(json.dumps(job(albedo=0.4)))
        self.write("jobs.jsonl", "\n".join(lines[:2]) + "\n\n" + "\n".join(lines[2:]))
        first = self.gonio("batch", "jobs.jsonl", "-o", "out", code=1)
        self.assertEqual(self.files(), ["jobs.jsonl", "out/0.1.csv", "out/0.2.csv", "out/jobs-5.csv"])
        self.assertIn("4 jobs: 3 done, 0 skipped, 1 failed, 0 not run", first.stderr)
        self.assertIn("jobs.jsonl:2: /material/albedo = 2", first.stderr)
        stamp = (self.folder / "out/0.1.csv").stat().st_mtime_ns
        second = self.gonio("batch", "jobs.jsonl", "-o", "out", "--json", code=1)
        self.assertEqual([json.loads(line)["status"] for line in second.stdout.splitlines()],
                         ["skipped", "failed", "skipped", "skipped"])
        self.assertEqual((self.folder / "out/0.1.csv").stat().st_mtime_ns, stamp)
        # Another seed is another job on the same file.
        lines[1] = json.dumps(job(albedo=0.1, accuracy={"seed": 9}, output=[{"format": "csv", "path": "0.1.csv"}]))
        self.write("jobs.jsonl", "\n".join(lines[1:]))
        third = self.gonio("batch", "jobs.jsonl", "-o", "out")
        self.assertIn("3 jobs: 2 done, 1 skipped, 0 failed", third.stderr)

    def test_every_output_must_be_there(self):
        self.write("a.json", job(output=[{"format": "csv"}, {"format": "exr"}]))
        self.gonio("batch", ".", "-o", "out")
        (self.folder / "out/a.exr").unlink()
        self.assertIn("1 done", self.gonio("batch", ".", "-o", "out").stderr)
        self.assertTrue((self.folder / "out/a.exr").exists())
        for kind in ("json", "exr"):  # the hash is found in each format
            self.write("a.json", job(output=[{"format": kind}]))
            self.gonio("batch", ".", "-o", "out")
            self.assertIn("1 skipped", self.gonio("batch", ".", "-o", "out").stderr)

    def test_folder_in_order_of_names(self):
        (self.folder / "jobs").mkdir()
        for name, albedo in (("b", 0.2), ("a", 0.1)):
            self.write(f"jobs/{name}.json", job(albedo=albedo))
        self.write("jobs/c.json", "{")
        result = self.gonio("batch", "jobs", "-o", "out", "--json", code=1)
        self.assertEqual([json.loads(line)["job"] for line in result.stdout.splitlines()], ["a.json", "b.json", "c.json"])
        self.assertEqual(self.files(), ["jobs/a.json", "jobs/b.json", "jobs/c.json", "out/a.csv", "out/b.csv"])

    def test_two_jobs_for_one_file(self):
        lines = [json.dumps(job(albedo=a, output=[{"format": "csv", "path": "same.csv"}])) for a in (0.1, 0.2)]
        self.write("jobs.jsonl", "\n".join(lines))
        self.assertIn("is written by jobs.jsonl:1 already", self.gonio("batch", "jobs.jsonl", code=1).stderr)

    def test_example(self):
        self.gonio("batch", SOURCE / "clients/examples/batch.jsonl")
        self.assertEqual(self.files(), ["batch-3.csv", "v_groove_20.csv", "v_groove_45.csv"])

    def test_nothing_to_do(self):
        self.assertIn("holds no job", self.gonio("batch", ".", code=3).stderr)
        self.assertIn("no such file", self.gonio("batch", "nowhere.jsonl", code=3).stderr)


class Interruption(Program):
    def start(self, *arguments):
        process = subprocess.Popen([GONIO, *map(str, arguments)], cwd=self.folder, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)  # first: what a failing test leaves would run for ever
        return process

    def stop(self, process, sent, times=1):
        for _ in range(times):
            process.send_signal(sent)
            time.sleep(0.05)
        out, err = process.communicate(timeout=60)
        return out, err

    def test_leaves_nothing_partial(self):
        self.write("a.json", endless_job("a.csv"))
        for sent, code in ((signal.SIGINT, 130), (signal.SIGTERM, 5)):
            with self.subTest(sent):
                process = self.start("run", "a.json", "-o", "out", "--json")
                while "rms" not in process.stderr.readline():  # the surface is shown, then the work begins
                    self.assertIsNone(process.poll())
                time.sleep(1)
                begin = time.monotonic()
                out, err = self.stop(process, sent)
                self.assertEqual(process.returncode, code, err)
                self.assertLess(time.monotonic() - begin, 20)
                self.assertEqual(json.loads(out)["code"], "cancelled")
                self.assertIn("cancelled", err)
                self.assertEqual(self.files(), ["a.json"])

    def test_second_signal_aborts(self):
        self.write("a.json", endless_job("a.csv"))
        process = self.start("run", "a.json", "-o", "out")
        while "rms" not in process.stderr.readline():
            self.assertIsNone(process.poll())
        self.stop(process, signal.SIGINT, times=2)
        # Cancelled between the two signals, if the engine was quick.
        self.assertIn(process.returncode, (-signal.SIGINT, 130))
        self.assertEqual(self.files(), ["a.json"])

    def test_batch_keeps_finished_results(self):
        lines = [job(output=[{"format": "csv", "path": "first.csv"}]), endless_job("second.csv"),
                 job(albedo=0.1, output=[{"format": "csv", "path": "third.csv"}])]
        self.write("jobs.jsonl", "\n".join(map(json.dumps, lines)))
        process = self.start("batch", "jobs.jsonl")
        while "jobs.jsonl:1: done" not in process.stderr.readline():
            self.assertIsNone(process.poll())
        time.sleep(1)
        out, err = self.stop(process, signal.SIGINT)
        self.assertEqual(process.returncode, 130, err)
        self.assertIn("3 jobs: 1 done, 0 skipped, 0 failed, 2 not run", err)
        self.assertEqual(self.files(), ["first.csv", "jobs.jsonl"])


class Others(Program):
    def test_info(self):
        scan = SOURCE / "tests/samples/afm_rough.gsf"
        text = self.gonio("info", scan).stdout
        for word in ("256 x 256 points", "39.06 nm", "Sq 35.2", "steepest", "wrap jump", "warning"):
            self.assertIn(word, text)
        facts = json.loads(self.gonio("info", scan, "--json").stdout)
        self.assertAlmostEqual(facts["sq_m"] / 35.22e-9, 1, places=3)
        self.assertAlmostEqual(facts["pitch_x_m"], 10e-6 / 256)
        self.assertTrue(facts["warnings"])
        self.assertIn("--width", self.gonio("info", LAVA, "--height-range", "5mm", code=3).stderr)

    def test_reference_is_another_result(self):
        self.write("a.json", job(GROOVE))
        fast = json.loads(self.gonio("run", "a.json", "--json").stdout)
        slow = json.loads(self.gonio("reference", "a.json", "--paths", 4096, "--json").stdout)
        self.assertEqual(slow["outputs"], [{"format": "csv", "path": "a.reference.csv"}])
        self.assertNotEqual(fast["job_hash"], slow["job_hash"])

        def values(name):
            rows = [line for line in (self.folder / name).read_text().splitlines() if line[0].isdigit()]
            return [[float(x) for x in row.split(",")] for row in rows]

        for a, b in zip(values("a.csv"), values("a.reference.csv"), strict=True):
            self.assertEqual(a[:4], b[:4])
            self.assertLess(abs(a[4] - b[4]), 5 * (a[5] + b[5]) + a[6] + b[6] + 1e-6)

    def test_plot(self):
        self.write("a.json", job(GROOVE, output=[{"format": "csv"}, {"format": "json", "path": "t.json"}]))
        self.gonio("run", "a.json", "-q")
        self.gonio("plot", "a.csv", "-q")
        self.gonio("plot", "t.json", "-o", "b.svg", "-o", "b.png", "--incident", 0, "--log")
        self.assertIn("<svg", (self.folder / "a.svg").read_text())
        self.assertTrue((self.folder / "b.png").read_bytes().startswith(b"\x89PNG"))
        self.gonio("plot", "a.csv", "-o", "a.gif", code=3)
        self.gonio("plot", "a.json", code=3)
        self.gonio("plot", "nowhere.csv", code=3)

    def test_ndf(self):
        scan = SOURCE / "tests/samples/afm_rough.gsf"
        self.assertIn("ggx", self.gonio("ndf", scan).stdout.lower())
        answer = json.loads(self.gonio("ndf", scan, "--json", "-o", "ndf.svg").stdout)
        self.assertEqual({fit["model"] for fit in answer["fits"]}, {"beckmann", "ggx"})
        self.assertIn("<svg", (self.folder / "ndf.svg").read_text())

    def test_no_escape_codes_in_files(self):
        result = self.gonio("run", "nowhere.json", code=3)
        self.assertNotIn("\x1b", result.stderr)

    def on_terminal(self, env):
        self.write("a.json", job(GROOVE))
        mine, theirs = pty.openpty()
        environment = {**{k: v for k, v in os.environ.items() if k != "NO_COLOR"}, "TERM": "xterm", **env}
        subprocess.run([GONIO, "run", "a.json"], cwd=self.folder, stderr=theirs, env=environment, timeout=60, check=True)
        subprocess.run([GONIO, "run", "nowhere.json"], cwd=self.folder, stderr=theirs, env=environment, timeout=60)
        os.close(theirs)
        text = b""
        try:
            while piece := os.read(mine, 65536):
                text += piece
        except OSError:  # how Linux says that the other end is closed
            pass
        os.close(mine)
        return text.decode()

    def test_terminal_has_bar_and_colour(self):
        text = self.on_terminal({})
        self.assertIn("[#", text)
        self.assertIn("\x1b[1;31merror", text)
        text = self.on_terminal({"NO_COLOR": "1"})
        self.assertNotIn("\x1b[1;31m", text)
        text = self.on_terminal({"TERM": "dumb"})
        self.assertNotIn("\x1b", text)


class Shards(Program):
    def setUp(self):
        super().setUp()
        surface = {"generate": "gaussian", "samples": 64, "pitch": "1 um", "correlation_length": "2 um", "rms_slope": 1}
        hemisphere = {"hemisphere": 64}
        document = job(surface, 0.8, measure={"kind": "brdf", "incident": hemisphere, "outgoing": hemisphere},
                       accuracy={"target_relative_error": 0.003}, output=[{"format": "csv", "path": "a.csv"}])
        (self.folder / "a.json").write_text(json.dumps(document))

    def whole(self):
        self.gonio("run", "a.json", "-o", "whole")
        return (self.folder / "whole/a.csv").read_bytes()

    def test_shards_merge_to_the_bytes_of_one_run(self):
        rounds = 0
        while True:
            merge = subprocess.run([GONIO, "merge", "a.json", "--checkpoints", "work", "-o", "merged", "-q"],
                                   cwd=self.folder, capture_output=True, text=True, timeout=300)
            if merge.returncode == 0:
                break
            self.assertEqual(merge.returncode, 7, merge.stderr)
            self.assertFalse((self.folder / "merged").exists())
            rounds += 1
            for index in reversed(merge.stdout.split()):
                self.gonio("shard", "--job", "a.json", "--index", index, "--checkpoints", "work", "-q")
        self.assertGreaterEqual(rounds, 1)
        self.assertEqual((self.folder / "merged/a.csv").read_bytes(), self.whole())
        self.assertEqual(list((self.folder / "work").iterdir()), [], "shards are kept after the merge")

    def test_shards_out_of_order_are_refused(self):
        result = self.gonio("shard", "--job", "a.json", "--index", 6, "--checkpoints", "work", code=7)
        self.assertIn("0 1 2 3 4 5", result.stderr)
        self.gonio("shard", "--job", "a.json", "--index", 0, code=2)

    def test_reference_in_shards(self):
        (self.folder / "b.json").write_text(json.dumps(job(GROOVE, output=[{"format": "csv", "path": "b.csv"}])))
        arguments = ["--reference", 512, "--checkpoints", "work", "-q"]
        self.assertEqual(self.gonio("merge", "b.json", *arguments, code=7).stdout.split(), ["0", "1", "2", "3"])
        for index in range(4):
            self.gonio("shard", "--job", "b.json", "--index", index, *arguments)
        self.gonio("merge", "b.json", *arguments)
        self.gonio("reference", "b.json", "--paths", 512, "-o", "whole")
        self.assertEqual((self.folder / "b.reference.csv").read_bytes(),
                         (self.folder / "whole/b.reference.csv").read_bytes())

    def test_kill_9_costs_at_most_what_was_running(self):
        arguments = [GONIO, "run", "a.json", "-o", "resumed", "--checkpoints", "work", "--threads", "1", "-q"]
        kills, delay = 0, 0.05
        while True:
            process = subprocess.Popen(arguments, cwd=self.folder)
            try:
                self.assertEqual(process.wait(delay), 0)
                break
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                kills += 1
                delay = min(1.3 * delay, 60)  # so that each run of the engine fits in sooner or later
                table = self.folder / "resumed/a.csv"
                if table.exists():  # killed after the last rename: whole, then
                    self.assertEqual(table.read_bytes(), self.whole())
        self.assertGreater(kills, 0)
        self.assertEqual((self.folder / "resumed/a.csv").read_bytes(), self.whole())

    def test_damaged_shards_are_computed_again(self):
        self.gonio("shard", "--job", "a.json", "--index", 2, "--checkpoints", "work")
        shard = next((self.folder / "work").rglob("stage0-run2-*"))
        data = bytearray(shard.read_bytes())
        data[len(data) // 2] ^= 1
        shard.write_bytes(data)
        self.gonio("run", "a.json", "-o", "again", "--checkpoints", "work")
        self.assertEqual((self.folder / "again/a.csv").read_bytes(), self.whole())


if __name__ == "__main__":
    unittest.main()
