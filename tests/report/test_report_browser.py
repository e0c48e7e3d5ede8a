"""The page of a run in a real browser, headless: it opens from disk, plays, and obeys mouse and keyboard."""

import re
import shutil
import time

import pytest
from report_support import small_run

from socasadi.report import html_report

selenium = pytest.importorskip("selenium.webdriver", reason="selenium drives the browser")
BROWSER = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
)
DRIVER = shutil.which("chromedriver")
pytestmark = pytest.mark.skipif(
    not (BROWSER and DRIVER), reason="needs Chromium and its driver (apt-get install chromium chromium-driver)"
)
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking"),
    # Three dimensions without a graphics card.
    *("--disable-component-update", "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    return html_report(small_run(tmp_path_factory.mktemp("browser") / "run").folder)


@pytest.fixture(scope="module")
def started():
    options = selenium.ChromeOptions()
    options.binary_location = BROWSER
    for flag in (*FLAGS, "--window-size=1240,1000"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = selenium.Chrome(options=options, service=selenium.ChromeService(DRIVER))
    driver.set_script_timeout(60)
    yield driver
    driver.quit()


RESET = """
const by = (id) => document.getElementById(id);
if (by("play").textContent === "Pause") by("play").click();
window.scrollTo(0, 0);
by("speed").value = "1";
by("onward").checked = false;
by("trial").value = JSON.parse(by("data").textContent).shown;
by("trial").dispatchEvent(new Event("change"));
document.querySelector("[data-turn=side]").click();
"""


@pytest.fixture(scope="module")
def opened(started, page):
    """A browser in which the page was opened."""
    started.get(page.as_uri())
    until(lambda: started.execute_script("return document.documentElement.dataset.ready") == "true")
    return started


@pytest.fixture
def browser(opened):
    """The page as it was when it was opened."""
    opened.execute_script(RESET)
    yield opened
    severe = [line["message"] for line in opened.get_log("browser") if line["level"] == "SEVERE"]
    assert severe == []


def until(holds, seconds=60):
    """Wait for what the page will do; AssertionError when it does not."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "the page did not come to it"
        time.sleep(0.05)


def by_id(browser, name):
    return browser.find_element("id", name)


def clock(browser):
    return float(by_id(browser, "clock").text.split()[0])


def tip(browser):
    """Where the tip is drawn in three dimensions: y, z, x in mm."""
    script = (
        "const t = document.getElementById('scene').data, n = arguments[0]; return [t[n].x[0], t[n].y[0], t[n].z[0]]"
    )
    return browser.execute_script(script, 5)


def eye(browser):
    """From where the rod is seen, as it is drawn."""
    camera = "document.getElementById('scene')._fullLayout.scene._scene.getCamera().eye"
    return browser.execute_script(f"const at = {camera}; return [at.x, at.y, at.z]")


def test_it_opens_from_disk_with_every_plot_drawn(browser):
    for name in ("scene", "plane", "outputs", "inputs", "convergence", "slices"):
        drawn = browser.execute_script("return document.getElementById(arguments[0]).data.length", name)
        assert drawn > 0, name
    assert "the exported controller" in by_id(browser, "missing").text


def test_no_button_would_send_the_data_anywhere(browser):
    titles = browser.execute_script(
        "return [...document.querySelectorAll('.modebar-btn')].map(b => b.dataset.title || '')"
    )
    assert titles
    assert not [title for title in titles if re.search("share|cloud|studio", title, re.I)]


def test_play_moves_the_rod_in_time_and_pause_holds_it(browser):
    before = tip(browser)
    by_id(browser, "play").click()
    until(lambda: clock(browser) > 0.5)
    by_id(browser, "play").click()
    until(lambda: by_id(browser, "play").text == "Play")
    held, moved = clock(browser), tip(browser)
    assert max(abs(a - b) for a, b in zip(before, moved, strict=True)) > 5
    time.sleep(0.3)
    assert clock(browser) == held
    assert by_id(browser, "play").text == "Play"


@pytest.mark.slow
def test_it_plays_to_its_end_and_begins_anew(browser):
    browser.execute_script("document.getElementById('speed').value = '5'")
    by_id(browser, "play").click()
    until(lambda: clock(browser) == 6.0 and by_id(browser, "play").text == "Play")
    by_id(browser, "play").click()
    until(lambda: 0 < clock(browser) < 6.0)
    by_id(browser, "play").click()


def test_time_is_scrubbed_by_the_keyboard(browser):
    slider = by_id(browser, "time")
    slider.send_keys(*10 * [selenium.Keys.ARROW_RIGHT])
    assert clock(browser) == pytest.approx(0.5)
    slider.send_keys(selenium.Keys.END)
    assert clock(browser) == 6.0
    path = browser.execute_script(
        "const d = document.getElementById('plane').data; return [d.at(-1).x[0], d[1].x.at(-1)]"
    )
    assert path[0] == pytest.approx(path[1], abs=1e-9)


@pytest.mark.slow
def test_play_is_reached_and_pressed_by_the_keyboard(browser):
    by_id(browser, "play").send_keys(selenium.Keys.SPACE)
    until(lambda: clock(browser) > 0.1)
    by_id(browser, "play").send_keys(selenium.Keys.ENTER)
    until(lambda: by_id(browser, "play").text == "Play")


def test_the_view_turns_and_zooms_by_buttons_keys_and_mouse(browser):
    start = eye(browser)
    browser.find_element("css selector", '[data-turn="left"]').click()
    turned = eye(browser)
    assert turned != start
    assert sum(v * v for v in turned) == pytest.approx(sum(v * v for v in start))
    scene = by_id(browser, "scene")
    scene.send_keys("+")
    assert sum(v * v for v in eye(browser)) < 0.8 * sum(v * v for v in start)
    scene.send_keys(selenium.Keys.ARROW_UP)
    assert eye(browser)[2] > turned[2] / 1.15
    browser.find_element("css selector", '[data-turn="side"]').click()
    assert eye(browser) == pytest.approx(start)
    actions = selenium.ActionChains(browser)
    actions.move_to_element(scene).click_and_hold().move_by_offset(90, 30).move_by_offset(30, 0).release().perform()
    until(lambda: eye(browser) != pytest.approx(start))


def test_any_trial_can_be_watched(browser):
    first = by_id(browser, "trial").get_attribute("value")
    by_id(browser, "previous" if first != "1" else "next").click()
    other = by_id(browser, "trial").get_attribute("value")
    assert other != first
    marked = browser.execute_script("const d = document.getElementById('convergence').data; return d.at(-1).x[0]")
    assert str(marked) == other  # a serial run tells its trials in the order of asking
    by_id(browser, "best").click()
    assert by_id(browser, "trial").get_attribute("value") == str(
        browser.execute_script("return JSON.parse(document.getElementById('data').textContent).best")
    )


@pytest.mark.slow
def test_the_search_can_be_watched_in_turn(browser):
    by_id(browser, "trial").send_keys("1")
    until(lambda: by_id(browser, "trial").get_attribute("value") == "1")
    by_id(browser, "onward").click()
    by_id(browser, "time").send_keys(selenium.Keys.END, *4 * [selenium.Keys.ARROW_LEFT])
    by_id(browser, "play").click()
    until(lambda: by_id(browser, "trial").get_attribute("value") == "2")
    by_id(browser, "play").click()


def test_a_trial_is_chosen_in_the_plot_of_the_search(browser):
    shown = by_id(browser, "trial").get_attribute("value")
    wanted = "3" if shown != "3" else "2"
    browser.execute_script(
        "document.getElementById('convergence').emit('plotly_click', {points: [{customdata: Number(arguments[0])}]})",
        wanted,
    )
    assert by_id(browser, "trial").get_attribute("value") == wanted


def test_every_control_has_a_name(browser):
    """What a screen reader says of a button, a list or a slider is never empty."""
    for element in browser.find_elements("css selector", "button, select, input, [tabindex='0']"):
        if element.is_displayed():
            assert element.accessible_name.strip(), element.get_attribute("outerHTML")


def test_nothing_is_cut_off_on_a_small_screen(browser):
    try:
        browser.set_window_size(500, 900)
        wide = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"
        until(lambda: browser.execute_script(wide) <= 1)
    finally:
        browser.set_window_size(1240, 1000)


def test_a_screenshot_shows_the_rod(browser, tmp_path):
    """The picture of the scene is no empty field: the body, the cables, the axes."""
    import matplotlib.image

    by_id(browser, "scene").screenshot(str(tmp_path / "scene.png"))
    pixels = matplotlib.image.imread(tmp_path / "scene.png")[..., :3]
    inked = (abs(pixels - pixels[0, 0]).max(axis=2) > 0.05).mean()
    assert 0.02 < inked < 0.6
