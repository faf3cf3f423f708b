"""One server, one browser and one client whose part is reconstructed for all tests of the page: `done` is left as each test found it. Each
file has a second client of its own, which its tests may leave as they like."""

import pytest
from tests.app.lab.page.browser import LabPage, chromium, inked, lab, red


@pytest.fixture(scope="package")
def server():
    with lab("--points", "20000") as running:
        yield running


@pytest.fixture(scope="package")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="package")
def done(browser, server):
    """A client whose example is reconstructed of primitives alone, each a row to click, to edit and to lock."""
    page = LabPage(browser, server.url)
    page.wait_for_picture(lambda picture: inked(picture) > 3000)
    page.keys("g")  # the grid, whose lines would be counted as parts of the picture
    assert red(page.picture()) == 0
    page.choose("Language", "csg")
    page.tab("Program")
    page.run()
    yield page
    page.close()


@pytest.fixture(scope="module")
def phone(browser, server):
    """A second client, in a window of a telephone's size from the first."""
    page = LabPage(browser, server.url, 390, 844)
    page.keys("g")
    yield page
    page.close()
