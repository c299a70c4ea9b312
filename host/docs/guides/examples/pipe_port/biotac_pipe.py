"""``pipe:COMMAND``: a board at the other end of a program's pipes, as of ``ssh pi socat - /dev/ttyACM0,rawer``."""

import select
import shlex
import subprocess

from biotac import DeviceLostError
from biotac.link import Link


class PipeLink(Link):
    def __init__(self, port, pace):
        self.port, command = port, shlex.split(port.partition(":")[2])
        self._program = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)

    def read(self, timeout_s):
        came, _, _ = select.select([self._program.stdout], [], [], timeout_s)
        if came and not (data := self._program.stdout.read(65536)):
            raise DeviceLostError(f"{self.port}: the program has ended")
        return data if came else b""

    def write(self, data):
        self._program.stdin.write(data)

    def close(self):
        with self._program:
            self._program.kill()
