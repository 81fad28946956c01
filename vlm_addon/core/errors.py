# SPDX-License-Identifier: GPL-3.0-or-later
"""The one exception family of the project; operators and the command line turn it into reports and exit codes."""

from __future__ import annotations

LONGEST_PART = 300
"""Characters of a part of a message: what was given may be of any length."""


class VlmError(Exception):
    """Any failure a user can be told about in one sentence; ends a command with `exit_code`."""

    exit_code = 1


class InvalidInput(VlmError):
    """What was given cannot be used: names the object, the value found and the remedy."""

    exit_code = 2

    def __init__(self, subject: str, problem: str, remedy: str) -> None:
        self.subject = shortened(subject)
        self.problem = shortened(problem)
        self.remedy = remedy
        super().__init__(f"{self.subject}: {self.problem}; {remedy}")


class Cancelled(VlmError):
    """The user stopped the work; nothing was written."""

    def __init__(self, label: str) -> None:
        super().__init__(f"{label}: cancelled, nothing was changed")
        self.label = label


class DeviceError(VlmError):
    """No usable OpenGL device, or the device failed; the message says what was tried and what to install."""


class ShaderError(DeviceError):
    """A shader did not compile or link; the message names file and line."""


def shortened(text: str) -> str:
    """`text` of at most LONGEST_PART characters: what is too long loses its middle."""
    if len(text) <= LONGEST_PART:
        return text
    end = LONGEST_PART // 3
    return f"{text[: LONGEST_PART - end - 5]} ... {text[-end:]}"
