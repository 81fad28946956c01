# SPDX-License-Identifier: GPL-3.0-or-later
"""What a Blender under test prints, kept in a file and searched."""

import os
import sys


class Failure(Exception):
    """A step after which something does not hold."""


class Log:
    """What this process prints, C and Python alike, in a file that is searched after each step."""

    def __init__(self, path):
        self.path = path
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
        self.terminal = os.dup(1)
        for stream in (1, 2):
            os.dup2(self._file, stream)
        self._place = 0

    def mark(self):
        """Look at what is printed from here on."""
        sys.stdout.flush()
        self._place = self.path.stat().st_size

    def note(self, text):
        """A line of the campaign's own."""
        os.write(self._file, f"-- {text}\n".encode())

    def tell(self, text):
        """A line to the terminal."""
        os.write(self.terminal, f"{text}\n".encode())

    def since(self):
        """What was printed since the last look."""
        sys.stdout.flush()
        with self.path.open("rb") as file:
            file.seek(self._place)
            text = file.read().decode(errors="replace")
            self._place = file.tell()
        return text

    def require_no_traceback(self):
        """What was printed since the last look. Raises Failure where a handler printed a traceback."""
        text = self.since()
        if "Traceback" in text:
            raise Failure(text[text.index("Traceback") :][-1500:])
        return text
