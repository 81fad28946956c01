# SPDX-License-Identifier: GPL-3.0-or-later
"""The one exception family of the project; operators and the command line turn it into reports and exit codes."""

from __future__ import annotations


class VlmError(Exception):
    """Any failure a user can be told about in one sentence; ends a command with `exit_code`."""

    exit_code = 1


class InvalidInput(VlmError):
    """What was given cannot be used: names the object, the value found and the remedy."""

    exit_code = 2

    def __init__(self, subject: str, problem: str, remedy: str) -> None:
        super().__init__(f"{subject}: {problem}; {remedy}")
        self.subject = subject
        self.problem = problem
        self.remedy = remedy


class Cancelled(VlmError):
    """The user stopped the work; nothing was written."""

    def __init__(self, label: str) -> None:
        super().__init__(f"{label}: cancelled, nothing was changed")
        self.label = label


class DeviceError(VlmError):
    """No usable OpenGL device, or the device failed; the message says what was tried and what to install."""


class ShaderError(DeviceError):
    """A shader did not compile or link; the message names file and line."""
