"""Processes that tests stop and kill."""

from __future__ import annotations

import os
import signal
import subprocess
from typing import Any


def suspend(process: subprocess.Popen[Any]) -> None:
    """Suspend a process; returns when all its threads are stopped."""
    process.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, process.pid, os.WSTOPPED)
