"""The page in a browser while something is wrong: flags, a missing board, a slow line, a restarted server."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_page import SNAPSHOT, await_text, link_is, numbers, touch_until_shown, until

import biotac
from biotac.documents import tomllib
from biotac.wire import messages_gen as wire

ROOT = Path(__file__).parents[3]
FLAGS = tomllib.loads((ROOT / "protocol" / "link.toml").read_text(encoding="utf-8"))["flags"]["frame"]


def test_every_flag_is_told_in_the_contracts_words(make_player, view_of, open_page, touch) -> None:
    player = make_player()
    mask = sum(1 << flag["bit"] for name, flag in FLAGS.items() if name != "doc")
    touch = replace(touch, wire=touch.wire.copy())
    touch.wire["flags"] = mask
    player.script.put(touch)
    page = open_page(view_of(lambda: player))
    page.wait_for_selector("#flags [data-flag=FAULT]")
    shown = dict(
        page.eval_on_selector_all("#flags li, #notices li", "all => all.map(e => [e.dataset.flag, e.textContent])")
    )
    wanted = {k: k.replace("_", " ") + flag["doc"] for k, flag in FLAGS.items() if k != "doc"}
    assert shown == wanted
    assert page.get_attribute("#flags [data-flag=FAULT]", "data-kind") == "warn"
    assert page.get_attribute("#notices [data-flag=CONTACT]", "data-kind") == "calm"


def test_health_of_the_link(make_player, view_of, open_page, touch) -> None:
    player = make_player()
    status = replace(next(m for m in touch.messages if isinstance(m, wire.Status)), slots_late=11, messages_dropped=13)
    player.script.put(replace(touch, messages=[status]))
    page = open_page(view_of(lambda: player))
    value = "k => Number(document.querySelector(`#health [data-key=${k}]`).dataset.value)"
    until(page, "() => document.querySelector('#health [data-key=late]').dataset.value === '11'")
    seen = {key: page.evaluate(value, key) for key in ("lost", "crc", "other", "boardDropped")}
    assert seen == {"lost": 7, "crc": 3, "other": 0, "boardDropped": 13}
    assert page.get_attribute("#health [data-key=crc]", "data-kind") == "warn"


def test_a_missing_board_is_told_and_found_again(make_player, view_of, open_page, touch) -> None:
    players = [make_player(), make_player()]
    ready: list[Any] = []

    def opener() -> Any:
        if not ready:
            raise biotac.PortError("no port /dev/ttyACM0; `biotac list` shows the ports of this machine")
        return ready.pop()

    page = open_page(view_of(opener), expect="409")
    link_is(page, "lost")
    assert page.text_content("#link-words").startswith("No board: no port /dev/ttyACM0; `biotac list`")
    assert page.is_disabled("#tare")
    players[0].script.put(touch)
    ready.append(players[0])
    link_is(page, "live")
    page.wait_for_selector(".finger")
    players[0].script.put(biotac.DeviceLostError("/dev/ttyACM0 went away while it was open"))
    link_is(page, "lost")
    assert "Connection lost: /dev/ttyACM0 went away" in page.text_content("#link-words")
    assert page.evaluate("() => document.body.hasAttribute('data-stale')")
    assert players[0].closed
    players[1].script.put(touch)
    ready.append(players[1])
    link_is(page, "live")
    await_text(page, "The board is connected again.")
    page.keyboard.press("a")
    await_text(page, "Done as asked.")
    assert players[1].commands == [("tare", None)]


@pytest.mark.nightly
def test_a_finger_without_news_does_not_look_touched(make_player, view_of, open_page, touch) -> None:
    """For a board and for a program that stands still: the link is not known to be lost yet."""
    player = make_player()
    page = open_page(view_of(lambda: player))
    player.script.put(touch)
    page.wait_for_selector("body[data-stale] #touched:text('not known')")
    page.wait_for_selector("#link-words:has-text('what is shown is old')")
    touch_until_shown(page, player, touch)


def test_nothing_is_shown_of_a_board_that_came_back_without_its_sensor(make_player, view_of, open_page, touch) -> None:
    ready = [make_player() for _ in range(2)]
    before = ready[0]
    page = open_page(view_of(lambda: ready.pop(0), retry_s=0.0))  # the page hears nothing of so short a loss
    assert page.text_content("#touched") == "not known"
    touch_until_shown(page, before, touch)
    before.script.put(biotac.DeviceLostError("it was reset"))
    await_text(page, "The board is connected again.")
    page.wait_for_selector("body[data-stale] #touched:text('not known')")
    assert page.text_content("#link-words") == "No frames come from this finger."
    seen = page.evaluate(SNAPSHOT)
    told = [*seen["force_n"], *seen["torque_nmm"], *seen["poc_mm"], *seen["grip_n"], *(v for _, v in seen["signals"])]
    assert np.isnan(numbers([*told, seen["pdc"], seen["slip"]])).all()
    assert seen["trust"] == ["trust: NONE", wire.TRUST_DOC[wire.Trust.NONE]]
    assert page.locator("#flags li, #notices li").count() == 0


@pytest.mark.nightly
def test_a_finger_of_the_list_says_why_it_has_no_force(make_player, view_of, open_page, touch) -> None:
    """Not the reason of a second ago, and no missing tare where something else is missing."""
    player, says = make_player(), ".finger[data-finger='1'] .force:text-is('{}')"
    page = open_page(view_of(lambda: player))
    player.script.put(touch)
    page.wait_for_selector(says.format("\u2013"))
    for flags, words in ((biotac.FrameFlags.FAULT, "no force"), (biotac.FrameFlags.UNTARED, "no tare")):
        blind = replace(touch, wire=touch.wire.copy())
        blind.wire["flags"], blind.wire["force_100un"] = int(flags), wire.INVALID_I32
        player.script.put(blind)
        page.wait_for_selector(says.format(words))


@pytest.mark.nightly
@pytest.mark.parametrize("width", [1440, 1000, 390])
def test_the_page_keeps_its_height_whatever_the_flags_say(make_player, view_of, open_page, touch, width: int) -> None:
    player, seen = make_player(), []
    page = open_page(view_of(lambda: player), viewport={"width": width, "height": 800})
    shows = "n => fingers.childElementCount === 2 && document.querySelectorAll('#flags li, #notices li').length === n"
    for flags, count in ((wire.FrameFlags.CONTACT, 1), (0, 0), (0x7FFFFFFF, 31)):
        flagged = replace(touch, wire=touch.wire.copy())
        flagged.wire["flags"] = flags
        player.script.put(flagged)
        until(page, shows, count)
        seen.append(page.evaluate("document.documentElement.scrollHeight"))
    assert len(set(seen)) == 1, seen


@pytest.mark.nightly
def test_a_page_behind_a_slow_line_says_how_old_it_is(make_player, view_of, open_page, touch, monkeypatch) -> None:
    player, late_s, monotonic = make_player(), [0.0], time.monotonic
    monkeypatch.setattr(time, "monotonic", lambda: monotonic() - late_s[0])
    page = open_page(view_of(lambda: player))
    touch_until_shown(page, player, touch)
    late_s[0] = 30.0
    player.script.put(touch)
    until(page, "() => document.getElementById('link-words').textContent.startsWith('What is shown is 30 s old')")
    page.wait_for_selector("body[data-stale] #touched:text('not known')")
    late_s[0] = 0.0
    touch_until_shown(page, player, touch)


@pytest.mark.nightly
def test_the_page_finds_a_restarted_server(view, open_page) -> None:
    first = view("sim:drift.toml")
    page = open_page(first, expect="ERR_")
    link_is(page, "live")
    port = first.server.server_port
    first.close()
    link_is(page, "gone")
    assert "does not answer" in page.text_content("#link-words")
    second = view("sim:drift.toml", port=port)
    link_is(page, "live")
    page.wait_for_selector("#tare-state:text('REST')")
    page.goto(second.url)  # commands need the new one's token
    page.keyboard.press("t")
    await_text(page, "Tared finger 0.")


@pytest.mark.nightly
@pytest.mark.parametrize(("contact", "heavy"), [(biotac.FrameFlags.CONTACT, "600"), (biotac.FrameFlags(0), "400")])
def test_without_contact_numbers_are_dim_and_notices_are_apart(
    make_player, view_of, open_page, touch, contact: biotac.FrameFlags, heavy: str
) -> None:
    player = make_player()
    touch = replace(touch, wire=touch.wire.copy())
    flags = biotac.FrameFlags
    touch.wire["flags"] = int(contact | flags.TORSION_OK | flags.HELD | flags.FAULT)
    player.script.put(touch)
    page = open_page(view_of(lambda: player))
    page.wait_for_selector("#flags [data-flag=FAULT]")
    until(page, f"() => getComputedStyle(document.querySelector('[data-key=forceN]')).fontWeight === '{heavy}'")
    named = "place => [...document.querySelectorAll(`${place} li`)].map(e => e.dataset.flag).sort().join()"
    assert page.evaluate(named, "#flags") == "FAULT"
    assert page.evaluate(named, "#notices").replace("CONTACT,", "") == "HELD,TORSION_OK"
