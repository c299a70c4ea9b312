"""Every finding there is: how bad, what it means, what cures it. host/docs/doctor.md is made of this."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Severity(Enum):
    """How bad."""

    ERROR = "error"  # no data, or data that must not be trusted
    WARNING = "warning"  # data come, and something is not as it should be


@dataclass(frozen=True)
class Entry:
    """One kind of finding."""

    severity: Severity
    meaning: str
    cure: str


@dataclass(frozen=True)
class Finding:
    """One finding: ``seen`` is what was observed here, the rest is the catalogue's."""

    code: str
    seen: str

    @property
    def entry(self) -> Entry:
        """Its place in the catalogue."""
        return CATALOGUE[self.code]


E, W = Severity.ERROR, Severity.WARNING

CATALOGUE: dict[str, Entry] = {
    # ---- connection
    "no_board": Entry(
        E,
        "No USB device has our firmware's ids: nothing is plugged in, the cable carries power only, or the board runs "
        "something else.",
        "Plug the board in with a cable that carries data, straight into the computer; a board that is new gets its "
        "firmware with `biotac flash`. `biotac demo` works without one.",
    ),
    "several_boards": Entry(
        W,
        "More than one board is plugged in, so a command without PORT does not know which you mean.",
        "Name one: `biotac doctor serial:NUMBER`.",
    ),
    "no_serial_port": Entry(
        E,
        "The board is on USB, but the system made no serial port of it: the driver (cdc_acm on Linux) is missing or "
        "has not come up, or a container or virtual machine has the device but not the port.",
        "Load the driver (`sudo modprobe cdc_acm`), or hand the port to the container; then plug the board in again.",
    ),
    "in_loader": Entry(
        E,
        "A board waits in its loader, as the drive RPI-RP2, and runs no firmware: BOOTSEL was held while it was "
        "plugged in, it was sent there, or its flash is empty.",
        "`biotac flash` writes the firmware, or copy biotac-pico.uf2 onto the drive. Plug it in again without BOOTSEL "
        "if it has its firmware.",
    ),
    "no_permission": Entry(
        E,
        "The port belongs to another user or group.",
        "`sudo biotac udev-setup` installs the rule that gives it to whoever sits at the computer (`biotac udev-setup "
        "--print` shows it); then plug the board in again. Without root: be added to the port's group, often dialout.",
    ),
    "port_busy": Entry(
        E,
        "Another program has the port for itself; two readers would each get half of the bytes.",
        "Close that program; then try again.",
    ),
    "port_shared": Entry(
        W,
        "Another program has the port open too, without asking for it alone: it may take bytes away from us.",
        "Close that program.",
    ),
    "modem_manager": Entry(
        W,
        "ModemManager takes a new serial port for a modem and sends it commands for some seconds after it was plugged "
        "in: opening fails with busy, or the first frames are lost.",
        "`sudo biotac udev-setup` tells it to leave our boards alone; then plug the board in again.",
    ),
    "port_failed": Entry(
        E,
        "The port is there or was named, but cannot be opened.",
        "See what was seen; `biotac list` shows the ports of this machine.",
    ),
    "not_a_gateway": Entry(
        E,
        "Something is on the port, but it does not answer as our firmware does within three seconds.",
        "Check that it is the board's port. If it is, plug it in again; if that does not help, `biotac flash`.",
    ),
    "board_lost": Entry(
        E,
        "The board went away or fell silent while it was being examined: cable, hub, power, or firmware that hangs.",
        "Try another cable and another USB socket without a hub; check the sensors' supply for short circuits.",
    ),
    # ---- version
    "wire_version": Entry(
        E,
        "Firmware and library speak different major versions of the protocol, and do not understand each other.",
        "`biotac flash` where the firmware is older, `pip install -U biotac-gateway` where the library is.",
    ),
    "schema_differs": Entry(
        W,
        "Firmware and library are of different releases of one protocol: they talk, but what only one of them knows "
        "is left out.",
        "`biotac flash` where the firmware is older, `pip install -U biotac-gateway` where the library is.",
    ),
    "firmware_older": Entry(
        W,
        "The board runs an older release than this package, without what has been mended or added since.",
        "`biotac flash`, which keeps the board's settings, calibrations and maps.",
    ),
    # ---- leads to a sensor board, with --sensor-port
    "lead_clock": Entry(
        E,
        "The sensor board heard no clock while one of its selects was low.",
        "Check SCK, then GND, then whether any select is connected at all.",
    ),
    "lead_mosi": Entry(
        E,
        "The sensors answer, but what they are told is no command: MOSI is open, or on another pin.",
        "Check MOSI at both ends.",
    ),
    "lead_miso": Entry(
        E,
        "The sensors answer, and the gateway reads zeros or ones only: MISO is open, or crossed with MOSI.",
        "Check MISO at both ends: it goes to MISO, not to MOSI.",
    ),
    "lead_select": Entry(
        E,
        "One finger's select does not come to its sensor; the other leads are right.",
        "Check this finger's SS at both ends.",
    ),
    "lead_crossed": Entry(
        E,
        "A select ends at another finger's sensor, which answers with its own serial number.",
        "Put the leads of SS in the order of the wiring table.",
    ),
    # ---- sensors
    "no_sensor": Entry(
        E,
        "The board answers, but none of its chip selects has a BioTac behind it that gives its serial number.",
        "Check V+ (3.3 to 5 V) at the sensor, GND, and MISO, MOSI, SCLK and SS against the board's wiring table.",
    ),
    "wrong_sensor": Entry(
        E,
        "A sensor of another type, as a BioTac SP (BTSP...), whose 24 electrodes lie elsewhere. Its counts are sent; "
        "all its frames carry SENSOR_UNSURE, for no force can be had of them here.",
        "Put a BioTac in its place.",
    ),
    "sensor_missing": Entry(
        E,
        "Fewer sensors answer than `--fingers` says there are.",
        "Check the missing sensor's plug, its SS wire and its supply.",
    ),
    "sensor_lost": Entry(
        E,
        "A sensor that answered at first gave no data, or stopped: a loose plug, or a supply that gives way.",
        "Reseat the flex connector; measure V+ at the sensor while all are running.",
    ),
    "sensor_unsure": Entry(
        W,
        "A sensor was away while the board streamed, and has not said its serial number since: tare, calibration and "
        "map may be another sensor's. Results go on as before, with the flag SENSOR_UNSURE.",
        "Reseat the flex connector, and take the strain off its cable. If it never says who it is, see words_error and "
        "words_parity, and plug it in again.",
    ),
    "sensor_other": Entry(
        E,
        "Another sensor answers than when the stream began. It has a tare of its own, and no results where it has not "
        "the same calibration and map; the flag SENSOR_OTHER says so.",
        "If you changed it: open the board again, and give this sensor its own calibration and map. If not, look for a "
        "wire of SS that goes to two sensors, or to another one than you think.",
    ),
    "same_serial": Entry(
        E,
        "Two fingers give the same serial number: one sensor listens to two chip selects, or two are shorted.",
        "Check the SS wires against the board's wiring table, and for shorts.",
    ),
    "mixed_sensors": Entry(
        W,
        "The sensors are of different flex or software versions. They work together; scale and noise may differ.",
        "Nothing, if you know; calibrate each finger of its own, and do not carry a calibration over.",
    ),
    # ---- bus
    "words_stuck": Entry(
        E,
        "Words of all ones or all zeros, which no sensor sends. 0xFFFF: MISO is open, or the sensor has no power. "
        "0x0000: nothing drives MISO, a sensor is absent, or the line is shorted to ground. The counter does not tell "
        "which of the two.",
        "Measure V+ at the sensor; check MISO and SS of this finger; reseat its plug.",
    ),
    "words_parity": Entry(
        E,
        "Words with bad parity: bits flip on the way. Long or unshielded wires, missing ground, a supply that ripples, "
        "or two sensors that answer at once.",
        "Shorten the wires, put a ground beside each signal, check that each SS goes to one sensor only.",
    ),
    "words_error": Entry(
        E,
        "The sensor refuses commands with error words: it got a damaged command, was read too soon, or its model has "
        "no such channel.",
        "Check MOSI and SCLK of this finger. A channel that is unknown to the model stays missing, and is flagged.",
    ),
    # ---- timing
    "board_restarted": Entry(
        E,
        "The board started again while it was being examined: its supply gave way, its watchdog bit, or somebody reset "
        "it.",
        "Another cable and socket; feed the sensors from a supply of their own if they draw more than the board gives.",
    ),
    "faults_latched": Entry(
        W,
        "The board remembers faults of before this examination, be they of a single round: they stay until somebody "
        "clears them.",
        "See each flag in MESSAGES.md and safety.md; once its cause is known, `Hand.clear_faults()`.",
    ),
    "slots_late": Entry(
        E,
        "The board missed times at which it should have sampled: those channels are missing from their frames.",
        "On a Pico report it, with `biotac info --json`. On a Linux computer's own bus: fewer fingers, a faster bus, "
        "less other load.",
    ),
    "messages_dropped": Entry(
        W,
        "The board had messages for which the link had no room: the computer read too slowly, or stood still.",
        "Close other programs that use the port or the processor; avoid hubs; read in a thread of its own.",
    ),
    "frames_lost": Entry(
        W,
        "Frames that the board made did not come, by their sequence numbers.",
        "See messages_dropped and bytes_damaged: one of them usually says why.",
    ),
    "bytes_damaged": Entry(
        W,
        "Frames came with a bad checksum or length: something else writes to the port, takes bytes from it, or the "
        "cable is bad.",
        "Close other programs that use the port; another cable.",
    ),
    "rate_wrong": Entry(
        E,
        "The board does not sample as often as it says, by its own clock.",
        "Report it, with `biotac info --json`; do not trust times within a frame.",
    ),
    "clock_drift": Entry(
        W,
        "The board's clock runs fast or slow against this computer's by more than a crystal should.",
        "Is this computer's clock being set at this moment? Ask again in a few minutes. If it stays, the board's "
        "crystal is off; `Hand.clock` corrects for it as long as it is steady.",
    ),
    "clock_jumped": Entry(
        W,
        "The board's time and this computer's stopped to agree on the way: one of the clocks was set, or stood still.",
        "See board_restarted; otherwise let this computer not sleep while it records.",
    ),
    # ---- tare
    "no_tare": Entry(
        W,
        "The finger has no tare, so it gives no point of contact, force or torque: its signals never stood still.",
        "Let go of the finger for two seconds. If that does not help, look for vibration, or words_parity.",
    ),
    "tare_fault": Entry(
        E,
        "The tare machine has given up on the finger: more than two electrodes are railed or missing.",
        "See electrodes_railed and channel_missing.",
    ),
    "base_old": Entry(
        W,
        "The finger counts as touched for over a minute, in which drift went untracked: forces creep.",
        "Let go of it. If nothing touches it, tare it now: `Hand.tare(finger)`.",
    ),
    "electrodes_railed": Entry(
        E,
        "Electrodes at the end of their range, 0 or at least 4090 counts, in most frames: they carry no signal. The "
        "skin is dry, torn or empty, presses on the core, or a trace is broken.",
        "Look at the skin and the fluid (the manual's inflation check); let go of the finger and ask again.",
    ),
    "channel_missing": Entry(
        E,
        "A channel had no good word in most frames. What is computed goes on without it, and is flagged.",
        "See words_error, words_parity and slots_late: one of them says why. A model can be without a channel.",
    ),
}
