"""Processes that tests stop and kill."""

from __future__ import annotations

import os
import signal
import subprocess
from typing import Any


def suspend(process: subprocess.Popen[Any]) -> None:
    """Stop it in its tracks; returns when every thread of it stands still."""
    process.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, process.pid, os.WSTOPPED)
