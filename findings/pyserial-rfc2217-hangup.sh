#!/usr/bin/env bash
# pyserial's rfc2217:// raises a plain OSError (BrokenPipeError or ConnectionResetError), not its own SerialException,
# when the server takes the connection and hangs up, as ser2net does for a device that is gone. serial_for_url()
# raises SerialException for all else that goes wrong here, and that is what a program catches.
# Seen with pyserial 3.5; fails where that has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet pyserial==3.5
"$folder/venv/bin/python" - <<'END'
import socket
import threading

import serial


def hang_up(listening):
    connection, _ = listening.accept()
    connection.recv(3)
    connection.close()


listening = socket.create_server(("127.0.0.1", 0))
threading.Thread(target=hang_up, args=[listening], daemon=True).start()
try:
    serial.serial_for_url(f"rfc2217://127.0.0.1:{listening.getsockname()[1]}")
except OSError as error:
    raised = error
print(f"pyserial {serial.__version__}: {type(raised).__name__}, a SerialException: {isinstance(raised, serial.SerialException)}")
assert isinstance(raised, ConnectionError) and not isinstance(raised, serial.SerialException)
END
