"""Two emulated Picos, wired to each other: a gateway and a sensor board, each on a pty.

biotac-rig two-boards                    prints both ports; runs until Ctrl-C
biotac-rig two-boards "SS2 to nothing"   with a lead that ends elsewhere; its names are SCK MOSI MISO SS0..SS4
"""

from __future__ import annotations

from collections.abc import Sequence

from .two_picos import TwoPicos


def main(leads: Sequence[str]) -> int:
    """Start them, and wait."""
    boards = TwoPicos(None, pace=1.0, hold=False)
    try:
        for lead in leads:
            boards.do(f"lead {lead}")
        print(f"--port {boards.path} --sensor-port {boards.sensor_path}", flush=True)
        while not boards.over:
            boards.receive(None)
    except KeyboardInterrupt:
        pass
    finally:
        boards.close()
    return 0
