"""Every finding: its severity, meaning and cure. host/docs/reference/doctor.md is generated from this."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Literal


@dataclass(frozen=True)
class Entry:
    severity: Literal["error", "warning"]  # data must not be trusted; or something else is not as it should be
    meaning: str
    cure: str


@dataclass(frozen=True)
class Finding:
    """One finding: ``seen`` is what was observed here; the rest is in the catalogue."""

    code: str
    seen: str

    @property
    def entry(self) -> Entry:
        return CATALOGUE[self.code]


error, warning = partial(Entry, "error"), partial(Entry, "warning")

CATALOGUE: dict[str, Entry] = {
    # ---- connection
    "no_board": error(
        "No USB device has our firmware's ids: nothing is plugged in, the cable carries power only, or the board runs "
        "something else.",
        "Plug the board in with a cable that carries data, straight into the computer; a board that is new gets its "
        "firmware with `biotac flash`. `biotac demo` works without one.",
    ),
    "several_boards": warning(
        "More than one board is plugged in, so a command without PORT does not know which you mean.",
        "Name one: `biotac doctor serial:NUMBER`.",
    ),
    "no_serial_port": error(
        "The board is on USB, but the system made no serial port of it: the driver (cdc_acm on Linux) is missing or "
        "has not come up, or a container or virtual machine has the device but not the port.",
        "Load the driver (`sudo modprobe cdc_acm`), or hand the port to the container; then plug the board in again.",
    ),
    "in_loader": error(
        "A board waits in its loader, as the drive RPI-RP2, and runs no firmware: BOOTSEL was held while it was "
        "plugged in, it was sent there, or its flash is empty.",
        "`biotac flash` writes the firmware, or copy biotac-pico.uf2 onto the drive. Plug it in again without BOOTSEL "
        "if it has its firmware.",
    ),
    "no_permission": error(
        "The port belongs to another user or group.",
        "`sudo biotac doctor --udev-rule install` installs the rule that gives it to whoever sits at the computer "
        "(`biotac doctor --udev-rule print` shows it); then plug the board in again. Without root: be added to the "
        "port's group, often dialout.",
    ),
    "port_busy": error(
        "Another program has the port to itself; two readers would each get half of the bytes.",
        "Close that program; then try again.",
    ),
    "port_shared": warning(
        "Another program has the port open too, though not exclusively: it may take some of our bytes.",
        "Close that program.",
    ),
    "modem_manager": warning(
        "ModemManager takes a new serial port for a modem and sends it commands for some seconds after it is plugged "
        "in: opening fails with busy, or the first frames are lost.",
        "`sudo biotac doctor --udev-rule install` tells it to leave our boards alone; then plug the board in again.",
    ),
    "port_failed": error(
        "The port is there or was named, but cannot be opened, or is no board.",
        "Read the message above; `biotac list` shows this machine's ports.",
    ),
    "not_a_gateway": error(
        "Something is on the port, but it does not answer as our firmware does within three seconds.",
        "Check that it is the board's port. If it is, plug it in again; if that does not help, `biotac flash`.",
    ),
    "board_lost": error(
        "The board went away or fell silent while it was being examined: cable, hub, power, or firmware that hangs.",
        "Try another cable and another USB socket without a hub; check the sensors' supply for short circuits.",
    ),
    "refused": error(
        "The board answers, but refuses to be examined: LINK_BUSY while the host at its other port streams or holds a "
        "finger.",
        "End that, or use `biotac doctor --take-link`, which ends its stream and leaves held what it holds.",
    ),
    "rounds": warning(
        "The rounds are another driver's messages, and this was found about them: what they lack, and what was done.",
        "host/docs/guides/owners.md has what each means, and what the numbers are worth.",
    ),
    # ---- version
    "wire_version": error(
        "Firmware and library speak different major versions of the protocol, and do not understand each other.",
        "`biotac flash` where the firmware is older, `pip install -U biotac-gateway` where the library is.",
    ),
    "schema_differs": warning(
        "Firmware and library are of different releases of one protocol: they talk, but what only one of them knows "
        "is left out.",
        "`biotac flash` where the firmware is older, `pip install -U biotac-gateway` where the library is.",
    ),
    "firmware_older": warning(
        "The board runs an older release than this package, and lacks what has been fixed or added since.",
        "`biotac flash`, which keeps the board's settings, calibrations and maps.",
    ),
    # ---- leads to a sensor board, with --sensor-port
    "lead_clock": error(
        "The sensor board heard no clock while one of its selects was low.",
        "Check SCK, then GND, then whether any select is connected at all.",
    ),
    "lead_mosi": error(
        "The sensors answer, but receive no valid command: MOSI is open, or on another pin.",
        "Check MOSI at both ends.",
    ),
    "lead_miso": error(
        "The sensors answer, and the gateway reads zeros or ones only: MISO is open, or crossed with MOSI.",
        "Check MISO at both ends: it goes to MISO, not to MOSI.",
    ),
    "lead_select": error(
        "One finger's select does not reach its sensor; the other leads are right.",
        "Check this finger's SS at both ends.",
    ),
    "lead_crossed": error(
        "A select ends at another finger's sensor, which answers with its own serial number.",
        "Put the leads of SS in the order of the wiring table.",
    ),
    # ---- sensors
    "no_sensor": error(
        "The board answers, but none of its chip selects has a BioTac behind it that gives its serial number.",
        "Check V+ (3.3 to 5 V) at the sensor, GND, and MISO, MOSI, SCLK and SS against the board's wiring table.",
    ),
    "wrong_sensor": error(
        "A sensor of another type, such as a BioTac SP (BTSP...), whose 24 electrodes lie elsewhere, or another skin. "
        "Its counts are sent, but no point and no force; all its frames carry SENSOR_FAULT.",
        "Replace it with a BioTac.",
    ),
    "sensor_missing": error(
        "Fewer sensors answer than `--fingers` says there are.",
        "Check the missing sensor's plug, its SS wire and its supply.",
    ),
    "sensor_lost": error(
        "A sensor that answered at first gave no data, or stopped: a loose plug, or a weak supply.",
        "Reseat the flex connector; measure V+ at the sensor while all are running.",
    ),
    "sensor_unsure": warning(
        "A sensor was away while the board streamed, and has not given its serial number since: tare, calibration and "
        "map may be another sensor's. Results go on as before, with the flag SENSOR_UNSURE.",
        "Reseat the flex connector, and take the strain off its cable. If its serial number never comes, see "
        "words_error and words_parity, and plug it in again.",
    ),
    "sensor_other": error(
        "A different sensor answers than when the stream began. It gets a tare of its own, and no results unless it "
        "has the same calibration and map; the flag SENSOR_OTHER says so.",
        "If you changed it: open the board again, and give this sensor its own calibration and map. If not, look for "
        "an SS wire that goes to two sensors, or to the wrong one.",
    ),
    "same_serial": error(
        "Two fingers give the same serial number: one sensor listens to two chip selects, or two are shorted.",
        "Check the SS wires against the board's wiring table, and for shorts.",
    ),
    "mixed_sensors": warning(
        "The sensors have different flex or software versions. They work together; scale and noise may differ.",
        "Nothing, if that is intended; calibrate each finger separately, and do not copy a calibration to another.",
    ),
    # ---- bus
    "words_stuck": error(
        "Words of all ones or all zeros, which no sensor sends. 0xFFFF: MISO is open, or the sensor has no power. "
        "0x0000: nothing drives MISO, a sensor is absent, or the line is shorted to ground. The counter does not tell "
        "which of the two.",
        "Measure V+ at the sensor; check MISO and SS of this finger; reseat its plug.",
    ),
    "words_parity": error(
        "Words with bad parity: bits flip on the way. Long or unshielded wires, missing ground, a supply that ripples, "
        "or two sensors that answer at once.",
        "Shorten the wires, put a ground beside each signal, check that each SS goes to one sensor only.",
    ),
    "words_error": error(
        "The sensor refuses commands with error words: it got a damaged command, was read too soon, or its model has "
        "no such channel.",
        "Check MOSI and SCLK of this finger. A channel that is unknown to the model stays missing, and is flagged.",
    ),
    # ---- timing
    "board_restarted": error(
        "The board restarted during the examination: its supply failed, its watchdog fired, or somebody reset it.",
        "Try another cable and socket; give the sensors their own supply if they draw more than the board provides.",
    ),
    "faults_latched": warning(
        "The board remembers faults from before this examination, even of a single round, until somebody clears them.",
        "Look up each flag in MESSAGES.md and safety.md; once you know its cause, call `Hand.board.clear_faults()`.",
    ),
    "slots_late": error(
        "The board missed sampling times: those channels are missing from their frames.",
        "On a microcontroller, report it with the output of `biotac info --json`. On a Linux computer's own bus, use "
        "fewer fingers or a faster bus, or stop other programs.",
    ),
    "messages_dropped": warning(
        "The board had messages for which the link had no room: the computer read too slowly, or stalled.",
        "Close other programs that use the port or the processor; avoid hubs; read in a thread of its own.",
    ),
    "frames_lost": warning(
        "Frames that the board sent did not arrive, by their sequence numbers.",
        "See messages_dropped and bytes_damaged: one of them usually says why.",
    ),
    "bytes_damaged": warning(
        "Frames came with a bad checksum or length: something else writes to the port, takes bytes from it, or the "
        "cable is bad.",
        "Close other programs that use the port; try another cable.",
    ),
    "rate_wrong": error(
        "The board does not sample as often as it says, by its own clock.",
        "Report it with the output of `biotac info --json`; do not trust times within a frame.",
    ),
    "clock_drift": warning(
        "The board's clock runs fast or slow against this computer's by more than a crystal should.",
        "This computer's clock may just be adjusting: run the doctor again in a few minutes. If it stays, the board's "
        "crystal is off; `Hand.clock` corrects for that while it is steady.",
    ),
    "clock_jumped": warning(
        "The board's time and this computer's jumped apart: one of the clocks was set, or stood still.",
        "See board_restarted; otherwise keep this computer from sleeping while it records.",
    ),
    # ---- the first evening, with --bringup
    "flash_unknown": warning(
        "The flash chip is not a Raspberry Pi Pico's: a clone of the board, whose erases may take longer and whose "
        "commands may differ.",
        "Try it with nothing at stake first: save settings, cut the power, compare. Tell us the id and the board.",
    ),
    "chip_old": warning(
        "The RP2040 has revision B0 or B1, of before late 2021. Behind a busy hub it may not come out of a reset "
        "of the bus (RP2040-E5), and the firmware has no workaround: it then does not appear, or not again.",
        "Plug the board straight into the computer, or take one with revision B2.",
    ),
    "dma_late": error(
        "Slots were lost because the DMA was late with a word; when it is late 44 times in a row, the core clocks the "
        "bus itself until the next start.",
        "`hand.board.set_setting(Setting.SLOTS_BY_CORE, 1)`, `hand.board.save_settings()` and a restart make that "
        "last. Report it with bringup.md.",
    ),
    "early_fault": error(
        "The board had to start more than once: its image was read wrongly, or an exception came before it ran.",
        "Flash it again. If that does not help, its flash is bad, or its supply at power-on.",
    ),
    "flash_slow": error(
        "Erasing a sector of flash takes longer than a Pico's chip ever does. Saving holds up sampling meanwhile, and "
        "from two seconds on the watchdog restarts the board in the middle of it.",
        "Do not save settings or maps while anything is held. Use a board with a W25Q16JV.",
    ),
    "supply": error(
        "The board's supply (VSYS) is outside its range: a weak USB socket or hub, a long cable, or sensors that draw "
        "too much.",
        "Plug the board straight into the computer with a short cable; give the sensors their own 3.3 V.",
    ),
    "clock_off": error(
        "The board's clock differs from USB's frames by more than crystal and host may: all rates and times are off by "
        "as much.",
        "Try another computer, to know which of the two it is. A board whose crystal is off must be replaced.",
    ),
    "slots_jitter": warning(
        "Rounds do not begin at equal steps: something holds off the board's interrupts.",
        "Report it with bringup.md.",
    ),
    "usb_frames": error(
        "Starts of frame are lost between the computer and the board: a hub, a cable or interference spoils USB.",
        "Connect the board without the hub, with another cable; keep motors' wires away from it.",
    ),
    "bus_margin": error(
        "The sensors' words come damaged at bus rates hardly above the usual one: warmth, another cable or a weaker "
        "supply will spoil them at the usual one, too.",
        "Shorten the leads, put a ground beside SCK, or 33 to 68 Ohm in series with SCK and MOSI at the board.",
    ),
    "not_pressed": warning(
        "Nobody pressed the finger when asked to, so nothing is known of its static pressure.",
        "Run it again, and press every finger on its pad with some newtons.",
    ),
    "pdc_warm": warning(
        "Static pressure moves with temperature by more than expected: a warm object looks like a touch.",
        "Tell us the number. Let the finger warm up before you tare it.",
    ),
    "restart": error(
        "After a restart the board told a fault, or had other sensors than after the first one.",
        "Check the sensors' supply and plugs; report it with bringup.md.",
    ),
    # ---- tare
    "no_tare": warning(
        "The finger has no tare, so it gives no point of contact, force or torque: its signals were never steady.",
        "Let go of the finger for two seconds. If that does not help, look for vibration, or words_parity.",
    ),
    "tare_fault": error(
        "The tare machine has given up on the finger: more than two electrodes are railed or missing.",
        "See channel_railed and channel_missing.",
    ),
    "base_old": warning(
        "The finger has counted as touched for over a minute. Only drift that all electrodes share is tracked "
        "meanwhile, so forces may creep.",
        "Let go of it. If nothing touches it, tare it now: `Hand.tare(finger)`.",
    ),
    # ---- signals
    "sensor_frozen": error(
        "Every channel says one and the same count, round after round. A live sensor has noise in each of them: its "
        "electronics hang, and what it says is as old as the moment at which they did.",
        "Unplug the sensor and plug it in again; measure V+ at the sensor. If it comes back so, replace it.",
    ),
    "channel_missing": error(
        "A channel had no good word in most frames. Results are computed without it and flagged.",
        "See words_error, words_parity and slots_late: one of them says why. Some models lack a channel.",
    ),
    "channel_railed": error(
        "A channel at the end of its range, 0 or at least 4090 counts, in most frames: it carries no signal. Of an "
        "electrode: the skin is dry, torn or empty, presses on the core, or a trace is broken. Of PDC: skin and core "
        "touch, or the pressure sensor is broken.",
        "Let go of the finger and run the doctor again; look at the skin and the fluid (the manual's inflation check).",
    ),
    "channel_stuck": error(
        "A channel says one and the same count, round after round, while others move: its amplifier or a trace is "
        "broken. The board does without such an electrode once the skin has moved, but not without PDC.",
        "Press the finger and look at the channel in `biotac view`. If it does not move, do not trust forces of this "
        "sensor, and have it repaired.",
    ),
    "electrode_alone": error(
        "An electrode moved while nothing touched the finger and the rest of the skin was still: it floats, drifts or "
        "is loose. The board does without it, and estimates its signal from the others'.",
        "Reseat the flex connector; look at the electrode in `biotac view`. It is used again, with a new tare, after "
        "two calm seconds at rest.",
    ),
    "electrodes_shorted": error(
        "Two electrodes moved, and said the same all the while: their traces touch. Each is a mean of both.",
        "Reseat the flex connector. If it stays, do not trust forces of this sensor, and have it repaired.",
    ),
    "channel_copied": error(
        "Two electrodes moved, and kept the same distance to the count all the while: one channel repeats the other's "
        "moves, as a multiplexer that does not switch, or software in between that mixed up columns.",
        "Look at both in `biotac view` while you press beside one of them. If it stays, do not trust forces of this "
        "sensor.",
    ),
    "electrodes_inverted": warning(
        "In a touch, an electrode's count rose by more than skin can bulge: counts fall where skin is compressed. "
        "Something inverts the counts, or the tare was taken while the finger was pressed.",
        "Let go of the finger for some seconds, and press its pad firmly again. If counts then rise where you press, "
        "do not trust forces: look for what inverts them between sensor and board.",
    ),
    "electrodes_shifted": error(
        "All electrodes moved alike and faster than anything warms, without pressure: their supply or reference "
        "dropped. Forces are off by it until the next tare.",
        "Let go of the finger, so that the board takes a new tare. Measure V+ at the sensor.",
    ),
    "sensor_exchanged": error(
        "From one round to the next the finger's words leapt further than any blow or warmth moves them: they are "
        "another channel's or another finger's, or its thermometer or PAC broke. Forces are not this finger's.",
        "Look whether cables were exchanged or are loose. If all is in order, tare the finger, which ends this; a "
        "power cycle makes the board look again at which sensor is where.",
    ),
    "pressure_flat": warning(
        "Static pressure hardly moves when the finger is pressed: fluid has leaked, there is a bubble in it, or the "
        "pressure element is cracked. A healthy finger gives 50 to 120 counts a newton. The board then judges contact "
        "by the electrodes alone, and stays in doubt for longer after a press.",
        "Press the finger firmly for some seconds while the doctor listens: it gives the counts per newton. Check the "
        "inflation and refill the finger as its manual says; until then tell the board when you grasp and let go.",
    ),
    "channel_noisy": error(
        "The count of an electrode jumps back and forth from round to round, as no press moves it: a trace or a "
        "contact is loose, or something couples into it. The board does without one or two; with more it takes no "
        "tare.",
        "Reseat the flex connector; keep motors' wires away from the sensor's. If it stays, do not trust forces of "
        "this sensor.",
    ),
}
