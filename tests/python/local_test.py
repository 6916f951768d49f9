"""gonio.run: the same job without a server."""
import signal
import subprocess
import unittest
from unittest import mock

import gonio
import numpy as np
from support import GONIO, JOB, LONG, MATERIAL, MEDIUM


class Local(unittest.TestCase):
    def test_progress(self):
        seen = []
        table = gonio.run(MEDIUM, program=GONIO, threads=1, progress=seen.append)
        self.assertEqual(table.shape, (1, 1, 3, 1, 1))
        self.assertEqual(seen[-1].progress, 100)
        self.assertTrue(seen[-1].message)

    def test_refused(self):
        with self.assertRaises(gonio.Refused) as caught:
            gonio.run(JOB, material=MATERIAL | {"albedo": 2}, program=GONIO)
        self.assertEqual((caught.exception.code, caught.exception.pointer), ("invalid_input", "/material/albedo"))
        self.assertEqual(str(caught.exception), "/material/albedo: 2: must be a number from 0 to 1")
        many = {"hemisphere": 1048576}
        with self.assertRaises(gonio.Refused) as caught:
            gonio.run(JOB, measure={"kind": "brdf", "incident": many, "outgoing": many}, program=GONIO)
        self.assertEqual(caught.exception.code, "limit")
        with self.assertRaises(gonio.Refused) as caught:
            gonio.run(JOB, surface={"grid": np.zeros((2, 2, 2))}, program=GONIO)
        self.assertEqual(caught.exception.pointer, "/surface/grid")
        with self.assertRaises(gonio.Refused):
            gonio.run("none.json", program=GONIO)
        with self.assertRaises(gonio.Refused) as caught:
            gonio.run(JOB, program=GONIO, threads=-1)
        self.assertEqual(caught.exception.code, "usage")

    def test_no_program(self):
        with self.assertRaises(gonio.Unreachable):
            gonio.run(JOB, program="/nonexistent/gonio")

    def test_timeout(self):
        with self.assertRaises(gonio.TimedOut):
            gonio.run(LONG, program=GONIO, timeout=0.3)

    def interrupted(self, number):
        """Runs a job of some seconds and sends a signal once it reports progress."""
        started = []

        def popen(*arguments, **options):
            started.append(process := real(*arguments, **options))
            return process

        real = subprocess.Popen
        with mock.patch("gonio.local.subprocess.Popen", popen):
            gonio.run(MEDIUM, program=GONIO, progress=lambda status: started[0].send_signal(number))

    def test_interrupted(self):
        for number in (signal.SIGTERM, signal.SIGINT):
            with self.assertRaises(gonio.JobDismissed):
                self.interrupted(number)
        with self.assertRaisesRegex(gonio.JobFailed, "signal 9"):
            self.interrupted(signal.SIGKILL)

    def test_no_program_is_left_behind(self):
        started = []

        def popen(*arguments, **options):
            started.append(process := real(*arguments, **options))
            return process

        real = subprocess.Popen
        with mock.patch("gonio.local.subprocess.Popen", popen), self.assertRaises(ZeroDivisionError):
            gonio.run(MEDIUM, program=GONIO, progress=lambda status: 1 / 0)
        self.assertEqual(started[0].returncode, 5)  # ended by SIGTERM, not by itself
