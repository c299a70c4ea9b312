"""The page of `biotac view` in a browser: waiting for it, and reading its numbers."""

from typing import Any

SNAPSHOT = """() => {
  const panel = document.getElementById("numbers");
  const cell = (key, axis) => panel.querySelector(`[data-key=${key}][data-axis=${axis}]`);
  const vector = (key) => ["x", "y", "z"].map((axis) => cell(key, axis).dataset.value);
  return {
    seq: Number(panel.dataset.seq), finger: Number(panel.dataset.finger), flags: Number(panel.dataset.flags),
    force_n: vector("forceN"), torque_nmm: vector("torqueNmm"), poc_mm: vector("pocMm"),
    pdc: panel.querySelector("[data-key=pdc]").dataset.value,
    celsius: panel.querySelector("[data-key=celsius]").dataset.value,
    slip: panel.querySelector("[data-key=slipLevel]").dataset.value,
    trust: [document.getElementById("trust").textContent, document.getElementById("trust-words").textContent],
    grip_n: [...document.querySelectorAll(".grip")].flatMap(({ dataset }) => [dataset.value, dataset.half]),
    signals: [...panel.querySelectorAll("[data-electrode]")].map((e) => [e.dataset.electrode, e.dataset.value]),
  };
}"""


def until(page: Any, condition: str, argument: Any = None) -> None:
    page.wait_for_function(condition, arg=argument)


def link_is(page: Any, link: str) -> None:
    page.wait_for_selector(f'#link[data-link="{link}"]')


def touch_until_shown(page: Any, player: Any, touch: Any) -> None:
    """A still value is old after half a second, in which a busy computer may not have drawn it."""
    for _ in range(1000):
        player.script.put(touch)
        if page.query_selector("body:not([data-stale]) #touched:text-is('contact')"):
            return
        page.wait_for_timeout(100)
    raise AssertionError("no contact is shown")


def await_text(page: Any, words: str) -> None:
    until(page, "w => reply.textContent.includes(w)", words)


def numbers(texts: list[str]) -> list[float]:
    return [float(text) for text in texts]  # float() reads JavaScript's NaN
