#!/usr/bin/env python3
"""Tab completion, typed into real shells, and the manual pages.

Usage: shells_test.py GONIO [Bash] [Zsh] [Fish] [ManPages]
"""
import os
import pathlib
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

GONIO = pathlib.Path(sys.argv.pop(1)).resolve()


def output(*command: str | os.PathLike[str], **options) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=120, **options).stdout


def subcommands() -> list[str]:
    return re.findall(r"^  (\S+) ", output(GONIO, "--help").split("Subcommands:")[1], re.MULTILINE)


class Folder(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio_shells_"))
        self.addCleanup(shutil.rmtree, self.folder)
        self.environment = {"HOME": str(self.folder), "TERM": "dumb", "LC_ALL": "C.UTF-8",
                            "PATH": f"{GONIO.parent}:{os.environ['PATH']}"}


class Completion:
    """What every shell must complete; `completed` of a subclass gives the line after Tab."""

    def test_completes_a_command(self):
        self.assertEqual(self.completed("gonio complet"), "gonio completions")

    def test_completes_an_option(self):
        self.assertEqual(self.completed("gonio run --no-s"), "gonio run --no-skip")

    def test_completes_an_option_behind_arguments(self):
        self.assertEqual(self.completed("gonio run --threads 2 job.json --dry"),
                         "gonio run --threads 2 job.json --dry-run")

    def test_completes_one_of_the_allowed_words(self):
        self.assertEqual(self.completed("gonio completions z"), "gonio completions zsh")

    def test_completes_a_file(self):
        (self.folder / "relief of lava.json").touch()
        self.assertEqual(self.completed("gonio run rel"), r"gonio run relief\ of\ lava.json")

    def test_completes_the_value_of_an_option(self):
        (self.folder / "relief.gsf").touch()
        self.assertEqual(self.completed("gonio serve --data rel"), "gonio serve --data relief.gsf")

    def test_leaves_alone_what_it_does_not_know(self):
        self.assertEqual(self.completed("gonio run --nothing-like"), "gonio run --nothing-like")


class Interactive(Completion):
    """A shell with a line editor on a terminal: a line, Tab, then quotes and `printf` around it."""
    command: list[str]
    start: str

    def completed(self, line: str) -> str:
        process, terminal = pty.fork()
        if process == 0:
            os.chdir(self.folder)
            os.execvpe(self.command[0], self.command, self.environment)
        try:
            # The keys wait in the terminal until the shell reads them. What it completed goes into a file, quoted.
            keys = f"{self.start}\n{line}\t\x05'\x01printf %s > line '\n"
            os.write(terminal, (keys + "exit\n").encode())
            text = b""
            while select.select([terminal], [], [], 60)[0]:
                try:
                    text += os.read(terminal, 4096)
                except OSError:  # the shell has closed it
                    break
            written = self.folder / "line"
            self.assertTrue(written.exists(), text.decode(errors="replace"))
            return written.read_text().rstrip()
        finally:
            try:
                os.kill(process, signal.SIGKILL)
            except ProcessLookupError:
                pass
            os.waitpid(process, 0)
            os.close(terminal)


class Bash(Interactive, Folder):
    command = ["bash", "--noprofile", "--norc", "-i"]
    start = "source <(gonio completions bash)"


class Zsh(Interactive, Folder):
    command = ["zsh", "-f", "-i"]
    start = "bindkey -e; autoload -U compinit; compinit -u -D; source <(gonio completions zsh)"


class Fish(Completion, Folder):
    def completed(self, line: str) -> str:
        words = output("fish", "--no-config", "-c", "gonio completions fish | source; complete -C $argv[1]", line,
                       env=self.environment, cwd=self.folder).split("\n")[0].split("\t")[0]
        if not words:
            return line
        return " ".join([*line.split(" ")[:-1], words.replace(" ", r"\ ") if "\\" not in words else words])


class ManPages(Folder):
    def setUp(self) -> None:
        super().setUp()
        output(GONIO, "man-pages", self.folder, "--date", "2025-01-31")

    def page(self, name: str) -> str:
        return output("mandoc", "-T", "utf8", "-O", "width=200", self.folder / f"{name}.1").replace("\b", "\0")

    def test_there_is_a_page_for_every_command(self):
        self.assertEqual({path.stem for path in self.folder.iterdir()},
                         {"gonio", *(f"gonio-{name}" for name in subcommands()),
                          *(f"gonio-store-{name}" for name in ("check", "gc", "export"))})

    def test_mandoc_has_nothing_to_say(self):
        output("mandoc", "-T", "lint", "-W", "warning", *sorted(self.folder.iterdir()))

    def test_every_option_of_the_help_is_in_the_page(self):
        for name in subcommands():
            page = re.sub(".\0", "", self.page(f"gonio-{name}"))  # overstrikes are how it writes bold
            for option in re.findall(r"^  (?:-\w,)?(--[\w-]+)", output(GONIO, name, "--help"), re.MULTILINE):
                self.assertIn(option, page, name)

    def test_a_bad_folder_is_named(self):
        missing = self.folder / "nothing"
        result = subprocess.run([GONIO, "man-pages", missing, "--date", "2025-01-31"], capture_output=True, text=True)
        self.assertNotEqual(result.returncode, 0)
        self.assertIn(str(missing), result.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
