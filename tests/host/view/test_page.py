"""The page as a person sees and uses it in a browser. By day views and commands, at night the rest."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from browser_page import SNAPSHOT, await_text, link_is, numbers, until
from record_all import record_all

import biotac
from biotac.wire import messages_gen as wire
from biotac.wire import sensor_gen as sensor
from biotac.wire.fields import INVALID_U8
from biotac.wire.frames import electrode_signals
from biotac_lab.features.thermal import thermal


def assert_shows(seen: dict[str, Any], frames: Any, signals: Any) -> None:
    """Everything on the panel is that frame's, to the last bit."""
    at = np.flatnonzero((frames["finger"] == seen["finger"]) & (frames["seq"] == seen["seq"]))
    assert len(at) == 1
    frame = frames[at[0]]
    for name in ("force_n", "torque_nmm", "poc_mm"):
        np.testing.assert_array_equal(numbers(seen[name]), frame[name])
    assert float(seen["pdc"]) == frame["pdc"]
    assert float(seen["celsius"]) == pytest.approx(thermal(frames)["celsius"][at[0]], rel=1e-12, nan_ok=True)
    slip_level = np.nan if frame["slip_level"] == INVALID_U8 else frame["slip_level"]
    np.testing.assert_array_equal(float(seen["slip"]), slip_level)
    assert seen["trust"] == [f"trust: {wire.Trust(frame['trust']).name}", wire.TRUST_DOC[frame["trust"]]]
    grip_n = [frame[name] for name in ("normal_n", "normal_half_n", "shear_n", "shear_half_n")]
    np.testing.assert_array_equal(numbers(seen["grip_n"]), grip_n)
    assert seen["flags"] == frame["flags"]
    assert [name for name, _ in seen["signals"]] == list(sensor.ELECTRODE_NAMES)
    np.testing.assert_array_equal(numbers([value for _, value in seen["signals"]]), signals[at[0]])


def test_numbers_are_those_of_the_frame_with_that_number(view, open_page) -> None:
    source = "sim:press.toml?fingers=2&seconds=30"
    page = open_page(view(source))
    with biotac.open(source) as hand:  # the same source gives the same bytes
        hand.stream("results", "events")  # as the page asks for: without events no slip is judged
        truth = hand.read_batch(60)
    signals = electrode_signals(truth.wire)
    contact = int(wire.FrameFlags.CONTACT)
    for finger in (0, 1):
        page.keyboard.press(str(finger))
        until(
            page,
            "([f, c]) => { const d = numbers.dataset; return d.finger === f && d.flags & c; }",
            [str(finger), contact],
        )
        seen = page.evaluate(SNAPSHOT)
        assert seen["finger"] == finger
        assert_shows(seen, truth.frames, signals)
    assert not np.isnan(numbers(seen["force_n"])).any()
    assert page.is_visible("#applied-key") and page.is_visible("td[data-key=appliedN]")


def test_a_recording_plays_on_the_same_page(view, open_page, tmp_path) -> None:
    path = tmp_path / "press.mcap"
    record_all("sim:press.toml?seconds=60", path)  # longer than a busy computer takes to pause it
    recording = biotac.Recording(path)
    page = open_page(view(str(path), again=False))
    link_is(page, "playing")
    page.wait_for_selector("#fingers .finger")
    until(page, "() => numbers.dataset.seq > 20")
    assert_shows(page.evaluate(SNAPSHOT), recording.frames, electrode_signals(recording.wire))
    assert page.is_visible("#applied-key") and page.is_visible("td[data-key=appliedN]")
    assert page.is_disabled("#tare") and page.is_disabled("#tare-all") and page.is_disabled("#record")
    page.click("#pause")
    link_is(page, "paused")
    page.keyboard.press("p")
    link_is(page, "playing")
    page.focus("#seek")
    page.keyboard.press("End")
    link_is(page, "over")
    assert page.text_content("#link-words") == "Playback finished."
    # The last picture comes after the word.
    until(page, "n => numbers.dataset.seq === n", str(recording.frames["seq"].max()))
    page.keyboard.press("g")
    link_is(page, "playing")


@pytest.mark.nightly
def test_a_recording_is_sought_marked_and_saved_by_keys_alone(view, open_page, tmp_path) -> None:
    path = tmp_path / "press.mcap"
    record_all("sim:press.toml?seconds=60&fingers=2", path)
    biotac.Recording(path).mark("slip", 40.0)
    page = open_page(view(str(path)))
    link_is(page, "playing")
    page.wait_for_selector("#marks button")
    page.focus("#pace")
    page.keyboard.press("Home")
    await_text(page, "Playing at 0.1 times its pace.")  # so slowly that a busy computer, too, shows where it went
    page.focus("#marks")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")  # to half a second before it
    until(page, "() => Math.abs(numbers.dataset.seq - 4000) < 300")
    assert page.get_attribute("#seek", "aria-valuetext").endswith("of 60.0 s")
    page.focus("#seek")
    page.keyboard.press("Home")
    until(page, "() => numbers.dataset.seq < 500")
    page.keyboard.press("p")  # or it might be over before it is marked
    link_is(page, "paused")
    page.focus("#pace")
    page.keyboard.press("5")
    await_text(page, "Playing at 5 times its pace.")
    page.focus("#mark-text")
    page.keyboard.type("tar")  # no command here
    page.focus("#mark")
    page.keyboard.press("m")
    await_text(page, "Marked 'tar' at ")
    until(page, "() => document.querySelectorAll('#marks li').length === 2")
    page.keyboard.press("s")
    await_text(page, "saved to ")
    (saved,) = set(tmp_path.glob("*.mcap")) - {path}
    assert biotac.Recording(saved).problems == []
    assert {label.text for label in biotac.Recording(path).labels} == {"slip", "tar"}
    with page.expect_download() as download:
        page.keyboard.press("i")
    assert download.value.suggested_filename == "biotac.png"


def test_five_fingers_are_a_hand_on_every_screen_and_each_can_be_picked(view, open_page) -> None:
    page = open_page(view("sim:drift.toml?fingers=5"))
    until(page, "() => document.querySelectorAll('.finger').length === 5")
    pick = "() => [...document.querySelectorAll('.finger[aria-pressed=true]')].map(b => b.dataset.finger).join()"
    shows = "f => [shown.textContent, numbers.dataset.finger].every((seen) => seen === f)"
    for act, finger in (
        (lambda: page.keyboard.press("3"), "3"),
        (lambda: page.click(".finger[data-finger='4']"), "4"),
        (lambda: page.keyboard.press("ArrowRight"), "0"),
        (lambda: page.keyboard.press("ArrowLeft"), "4"),
    ):
        act()
        until(page, shows, finger)
        assert page.evaluate(pick) == finger
    until(page, "() => Number(document.querySelector('[data-key=framesPerS]').dataset.value) > 0")
    page.set_viewport_size({"width": 1280, "height": 800})
    for place in (".finger[data-finger='0']", ".finger[data-finger='4']", "[data-key=framesPerS]", "#health", "#link"):
        box = page.locator(place).bounding_box()
        assert box["y"] >= 0 and box["y"] + box["height"] <= 800, place
        assert box["x"] >= 0 and box["x"] + box["width"] <= 1280, place
    page.set_viewport_size({"width": 360, "height": 740})
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 360


def test_tare_by_button_and_by_key(view, open_page) -> None:
    page = open_page(view("sim:drift.toml?fingers=2"))
    page.wait_for_selector("#tare-state:text('REST')")
    begun = int(page.evaluate(SNAPSHOT)["seq"])
    page.click("#tare")
    await_text(page, "Tared finger 0.")
    until(page, "w => document.getElementById('tare-reason').textContent === w", "TARE_NOW command")
    age_ms = float(page.get_attribute("#tare-age", "data-value"))
    rounds = int(page.evaluate(SNAPSHOT)["seq"]) - begun  # by the board's time, however late this computer is
    assert age_ms <= 10 * (rounds + 2)
    page.keyboard.press("a")
    await_text(page, "Tared fingers 0, 1.")


def test_a_refused_command_says_why_and_moves_nothing(make_player, view_of, open_page, touch) -> None:
    player = make_player()
    player.refusal = biotac.CommandRefusedError("finger 1: NOT_STILL " + "(release the finger, and more words) " * 4)
    player.script.put(touch)
    page = open_page(view_of(lambda: player), expect="409")
    link_is(page, "live")
    page.wait_for_selector(".finger")
    page.keyboard.press("1")
    until(page, "() => numbers.dataset.finger === '1'")  # the flags are other words than finger 0's
    before = page.locator("main").bounding_box()
    page.keyboard.press("t")
    await_text(page, "NOT_STILL")
    assert page.get_attribute("#reply", "data-kind") == "bad"
    assert page.locator("main").bounding_box() == before
    assert player.commands == [("tare", 1)]


@pytest.mark.nightly
def test_recording_starts_and_stops_by_key_and_is_whole(view, open_page, tmp_path) -> None:
    page = open_page(view("sim:drift.toml?fingers=2"))
    link_is(page, "live")
    page.keyboard.press("r")
    await_text(page, "Recording to ")
    page.wait_for_selector("#record[aria-pressed=true]")
    until(page, "() => parseFloat(document.getElementById('record-words').textContent.split(' ')[1]) >= 1")
    page.click("#record")
    await_text(page, "Recorded to ")
    page.wait_for_selector("#record[aria-pressed=false]")
    (path,) = tmp_path.glob("biotac-*.mcap")
    assert path.name in page.text_content("#reply")
    recording = biotac.Recording(path)
    # The only missing frames are those of a pause of this program, on a busy computer, which is told with the number;
    # how many come in a second of the page's depends on the computer.
    assert recording.problems == [gap.line() for gap in recording.gaps if gap.reason == "paused"]
    rounds = [recording.frames["t_us"][recording.frames["finger"] == finger] // 10_000 for finger in (0, 1)]
    missing = sum(int(row[-1] - row[0]) + 1 - len(row) for row in rounds)
    assert missing == sum(gap.frames_missed or 0 for gap in recording.gaps)
    assert recording.fingers == [0, 1] and len(recording.frames) > 10


@pytest.mark.nightly
def test_pause_freezes_the_picture_and_nothing_else(view, open_page) -> None:
    viewing = view("sim:drift.toml")
    page = open_page(viewing)
    until(page, "() => numbers.dataset.seq > 0")
    page.keyboard.press("p")
    page.wait_for_selector("#pause[aria-pressed=true]")
    assert "the board and any recording keep running" in page.text_content("#link-words")
    before = page.evaluate(SNAPSHOT)["seq"]
    cursor = viewing.state.cursor()
    viewing.state.wait(cursor, 0)
    until_frames = cursor.frames + 60
    while cursor.frames < until_frames:
        viewing.state.wait(cursor, 1.0)
    assert page.evaluate(SNAPSHOT)["seq"] == before
    page.click("#pause")
    until(page, "b => numbers.dataset.seq > b + 50", before)


@pytest.mark.nightly
def test_the_spectrum_is_numpys_and_texts_of_marks_never_overprint(view, open_page) -> None:
    page = open_page(view("sim:drift.toml"))
    samples = np.random.default_rng(5).normal(2000, 30, 1024) + 40 * np.sin(np.arange(1024) * 0.9)
    seen = page.evaluate("async (s) => [...(await import('./spectrum.js')).amplitudes(s)]", samples.tolist())
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(1024) / 1024)
    truth = np.abs(np.fft.rfft((samples - samples.mean()) * window)) / window.sum()
    truth[1:-1] *= 2
    np.testing.assert_allclose(seen, truth, rtol=1e-9, atol=1e-9)
    strongest = page.evaluate(
        """async () => {
          const { Finger } = await import('./model.js');
          const { SpectrogramPlot } = await import('./plots.js');
          const { readTheme } = await import('./colours.js');
          const finger = new Finger(0);
          for (let block = 0; block < 100; block++) {  // a second of silence, then one of 300 Hz
            const tone = block < 50 ? 0 : 400;
            const at = (k) => 2038 + tone * Math.sin(2 * Math.PI * 300 * (22 * block + k) / 2200);
            finger.addPac(block / 100, Array.from({ length: 22 }, (_, k) => at(k)));
          }
          const plot = new SpectrogramPlot(document.getElementById('spectrogram-plot'));
          plot.draw(finger, 2200, 0.37, readTheme());
          const { width, height } = plot.picture;
          const { data } = plot.picture.getContext('2d').getImageData(0, 0, width, height);
          const alpha = (x, y) => data[4 * (y * width + x) + 3];
          const rows = [...Array(height).keys()];
          const loudest = rows.reduce((a, b) => (alpha(width - 2, b) > alpha(width - 2, a) ? b : a));
          const before = Math.max(...rows.map((y) => alpha(width - 14, y)));
          return { hz: (height - 1 - loudest) * 1100 / (height - 1), before };
        }"""
    )
    assert abs(strongest["hz"] - 300) < 2200 / 128 and strongest["before"] == 0
    # Texts of marks never overprint.
    places = page.evaluate("""async () => {
      const { Finger } = await import('./model.js');
      const { TimePlot } = await import('./plots.js');
      const { readTheme } = await import('./colours.js');
      const finger = new Finger(), marks = [], lines = [({ forceN }) => forceN[0]];
      const frame = { forceN: [0, 0, 0], appliedN: [], gripN: [], pdc: 0, mapMm: null };
      for (let k = 0; k < 1000; k++) finger.add({ ...frame, tS: k / 100 });
      for (const s of [1, 3, 3.1, 3.2, 5, 5.4, 9.5, 9.9]) marks.push({ t_us: 1e6 * s, name: 'a slip' });
      const places = [], fill = CanvasRenderingContext2D.prototype.fillText;
      CanvasRenderingContext2D.prototype.fillText = function (text, x) {
        if (text === 'a slip') places.push([x, x + this.measureText(text).width]);
      };
      const force = new TimePlot(document.getElementById('force-plot'), lines, ['x'], { least: 1, digits: 1 });
      force.draw(finger, readTheme(), marks);
      CanvasRenderingContext2D.prototype.fillText = fill;
      return [...places.sort(([a], [b]) => a - b), [force.canvas.clientWidth]];
    }""")
    assert len(places) >= 4 and all(end < begin for (_, end), (begin, *_) in pairwise(places))


@pytest.mark.nightly
def test_the_fingertip_is_drawn_in_the_scales_colours(make_player, view_of, open_page, touch) -> None:
    player = make_player()
    messages = touch.wire[-1:].copy()
    messages["flags"] = 0
    messages["tare_q4"] = 2000 * 16
    messages["counts"] = 2000
    messages["counts"][0, 0] = 1500  # E1 compressed, E11 bulged, to the ends of the scale
    messages["counts"][0, 10] = 2500
    player.script.put(replace(touch, wire=messages, seq=touch.seq[-1:], t_us=touch.t_us[-1:], messages=[]))
    page = open_page(view_of(lambda: player), expect="willReadFrequently", color_scheme="light")
    until(page, "() => document.getElementById('scale-high').textContent === '+500'")
    places = {e: tuple(v / 1000 for v in sensor.ELECTRODE_UM[e]) for e in (0, 10)}
    pixel = """([a, b]) => {
      const canvas = document.getElementById("fingertip-canvas");
      const at = [(a + 9.5) / 19 * canvas.width, (9.8 - b) / 27 * canvas.height].map(Math.round);
      return [...canvas.getContext("2d").getImageData(at[0], at[1], 1, 1).data.slice(0, 3)];
    }"""
    style = "n => getComputedStyle(document.documentElement).getPropertyValue(n)"
    for electrode, name in ((0, "--compressed"), (10, "--bulged")):
        x, y, z = places[electrode]
        across = sensor.CORE_RADIUS_UM / 1000 * np.arctan2(y, -z)
        along = sensor.CORE_RADIUS_UM / 1000 * np.arcsin(x / (sensor.CORE_RADIUS_UM / 1000))
        colour = page.evaluate(style, name).strip()
        # beside the electrode's number, inside the disc
        assert page.evaluate(pixel, [across, along + 0.6]) == [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
