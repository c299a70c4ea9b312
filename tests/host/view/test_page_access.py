"""The page for everybody: contrast, names and themes, and every control by keys alone."""

from dataclasses import replace

import pytest
from record_all import record_all

import biotac


@pytest.mark.parametrize("scheme", ["light", pytest.param("dark", marks=pytest.mark.nightly)])
def test_axe_finds_nothing(make_player, view_of, open_page, touch, scheme: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install 'biotac-gateway[test]'")
    player = make_player()
    touch = replace(touch, wire=touch.wire.copy())
    touch.wire["flags"] = 0x3FFFF  # chips and warnings too
    player.script.put(touch)
    page = open_page(view_of(lambda: player), color_scheme=scheme)
    page.wait_for_selector("#flags [data-flag=FAULT]")
    page.click("summary")
    page.click("#pause")
    for is_listed in (False, True):
        if is_listed:
            page.click("#help")
            page.wait_for_selector("#keys[open]")
        found = axe.Axe().run(page).response
        doubts = [rule for rule in found["incomplete"] if rule["id"] != "color-contrast"]  # of disabled buttons' keys
        assert [(rule["id"], [node["target"] for node in rule["nodes"]]) for rule in found["violations"] + doubts] == []


@pytest.mark.nightly
def test_the_theme_can_be_chosen_and_stays(view, open_page) -> None:
    page = open_page(view("sim:drift.toml"), color_scheme="light")
    back = "() => getComputedStyle(document.body).backgroundColor"
    light = page.evaluate(back)
    page.keyboard.press("d")
    assert (page.text_content("#theme-words"), page.evaluate(back)) == ("light", light)
    page.keyboard.press("d")
    assert page.text_content("#theme-words") == "dark"
    dark = page.evaluate(back)
    assert dark != light
    page.reload()
    assert (page.text_content("#theme-words"), page.evaluate(back)) == ("dark", dark)


CONTROLS = """() => [...document.querySelectorAll("button, input, select, summary, ol")].flatMap((e, k) => {
  const { outlineStyle, outlineWidth } = getComputedStyle(e), isStop = !e.disabled && e.tabIndex >= 0;
  const isOutlined = e === document.activeElement && outlineStyle === "solid" && parseFloat(outlineWidth) >= 2;
  return isStop && e.checkVisibility() ? [[k, isOutlined]] : [];
})"""


@pytest.mark.nightly
@pytest.mark.parametrize("recorded", [False, True])
def test_every_control_is_reached_by_tab_and_shows_it(view, open_page, tmp_path, recorded: bool) -> None:
    """Also past a long list of marks, which is one stop."""
    source = "sim:drift.toml?fingers=2"
    if recorded:
        source = str(record_all("sim:press.toml?seconds=60&fingers=2", tmp_path / "a.mcap"))
        for k in range(40):
            biotac.Recording(source).mark(f"mark {k}", k / 10)
    page = open_page(view(source))
    page.wait_for_selector(".finger:nth-child(2)")
    page.keyboard.press("p")  # at the end a recording begins anew, with new buttons; this is long before
    page.wait_for_selector("#pause[aria-pressed=true]")
    missed = {control for control, _ in page.evaluate(CONTROLS)}
    assert len(missed) >= 12
    for _ in range(len(missed) + 1):
        page.keyboard.press("Tab")
        missed -= {control for control, is_outlined in page.evaluate(CONTROLS) if is_outlined}
    assert missed == set()


@pytest.mark.nightly
def test_keys_are_listed_and_do_nothing_behind_the_list(make_player, view_of, open_page) -> None:
    player = make_player()
    page = open_page(view_of(lambda: player))
    page.wait_for_selector('#link[data-link="live"]')
    page.keyboard.press("?")
    page.wait_for_selector("#keys[open]")
    for key in ("T", "A", "R", "P", "D", "0 … 4"):
        assert page.is_visible(f"#key-list kbd:text-is('{key}')")
    page.keyboard.press("t")
    page.keyboard.press("Escape")
    page.wait_for_selector("#keys", state="hidden")
    page.keyboard.press("a")
    page.wait_for_function("() => reply.textContent.includes('Done as asked.')")
    assert player.commands == [("tare", None)]
