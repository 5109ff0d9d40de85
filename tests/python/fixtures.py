# SPDX-License-Identifier: GPL-2.0-or-later
"""The base of the tests of python/incise: recordings of the simulated rig, made once by the real programs.

INCISE_BUILD is the build folder; by default the one beside the sources.
"""

import functools
import os
import shutil
import subprocess
import tempfile
import unittest

SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BUILD = os.environ.get("INCISE_BUILD", os.path.join(SOURCE, "build"))
SANITIZED = "asan" in os.environ.get("LD_PRELOAD", "")
SHORT = "sim:seed=1,clock=simulated,cut_s=2,pause_s=1"  # all 14 cuts, in 43 s


def run(*command, **options):
    """Run an incise program; its standard output. What it says of a failure is shown."""
    environment = {**os.environ, "PATH": os.path.join(BUILD, "bin") + ":" + os.environ["PATH"]}
    environment.pop("LD_PRELOAD", None)  # of a sanitizer, which is Python's
    return subprocess.run(
        command, check=True, stdout=subprocess.PIPE, env=environment, text=True, **options
    ).stdout


class Case(unittest.TestCase):
    """A test in a folder of its own, with recordings that are made once."""

    folder = None

    @classmethod
    def setUpClass(cls):
        cls.shared = _shared()

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="incise-python-")
        self.addCleanup(shutil.rmtree, self.folder)

    def path(self, name):
        return os.path.join(self.folder, name)

    def copy(self, name="short.rec"):
        """A recording that a test may change."""
        return shutil.copytree(os.path.join(self.shared, name), self.path(name))

    def sql(self, recording, sql):
        """SQL on a recording that has a row a sample in its tables; the rows of its answer, as texts."""
        program = os.path.join(BUILD, "tests/sql")
        answer = run(program, "-separator", "\t", os.path.join(recording, "recording.db"), sql)
        return [line.split("\t") for line in answer.splitlines()]

    def says(self, kind, text, call, *arguments, **options):
        """A call raises that exception with a line that has this text."""
        with self.assertRaises(kind) as caught:
            call(*arguments, **options)
        self.assertIn(text, str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))
        return caught.exception


@functools.lru_cache(maxsize=None)
def _shared():
    folder = os.environ.get("BATS_FILE_TMPDIR")  # for all of the tests that bats runs
    if not folder:
        folder = tempfile.mkdtemp(prefix="incise-python-shared-")
        import atexit

        pid = os.getpid()

        def remove():  # not by a child of a fork
            if os.getpid() == pid:
                shutil.rmtree(folder)

        atexit.register(remove)
    short = os.path.join(folder, "short.rec")
    if os.path.exists(os.path.join(folder, "pairs.csv")):
        return folder
    run("incise", "capture", "-o", short, "--rig", SHORT)
    run(
        "incise",
        "export",
        short,
        "-o",
        os.path.join(folder, "pairs.csv"),
        "--average",
        "12x10,by-cut",
    )
    return folder


def has(*names):
    """Whether packages can be imported."""
    import importlib.util

    return all(importlib.util.find_spec(name) for name in names)
