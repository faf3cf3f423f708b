"""Runs of several clients: their settings, pause and step, going on from an edited program, the queue, and what becomes of a run that ends
otherwise."""

import os
import signal
import socket
import subprocess
import time
from urllib.parse import urlsplit

import pytest
from tests.app.lab.page.browser import EXACT, WAIT_MS, LabPage, in_the_lab

pytestmark = in_the_lab


def test_the_server_listens_on_this_machine_alone(server):
    port = urlsplit(server.url).port
    with pytest.raises(OSError, match=r"refused|assign"):  # of another address of the same machine
        socket.create_connection(("127.0.0.2", port), timeout=5)


def test_the_method_that_was_chosen_runs(phone):
    phone.choose("Example", "Bracket")
    phone.says("Bracket")
    phone.choose("Method", "tree")
    phone.press("Step")  # to the first program: of the tree, where the search would have been first
    phone.says("paused")
    assert phone.status("stage").startswith("fit: tree")
    phone.press("Resume")
    phone.says("finished")
    phone.choose("Method", "auto")


def test_a_part_is_drawn_where_nothing_else_is_asked_for(phone):
    phone.choose("Example", "Lever")
    phone.says("Lever")
    phone.run()
    assert phone.status("features") == "4, 8 curves"
    assert phone.status("primitives") == ""


def test_a_run_is_stepped_paused_and_stopped(phone):
    phone.choose("Example", "Bracket, scanned")  # which takes its time
    phone.says("scanned")
    phone.press("Step")  # to the first program
    phone.says("paused")
    phone.says("volume")
    told = phone.status("stage")
    phone.keys("n")  # one step further
    phone.page.wait_for_function("t => !document.querySelector('.lab-status').textContent.includes(t)", arg=told)
    phone.says("paused")
    phone.press("Resume")
    phone.says("running")
    phone.press("Pause")
    phone.says("paused")
    phone.keys("p")
    phone.says("running")
    phone.press("Stop")
    phone.says("ready")
    phone.says("(stopped)")
    assert phone.volume() > 0, "what was found so far stays"


def test_an_evolution_goes_on_from_an_edited_program(done):
    done.select(3)
    done.keys("Delete")
    done.says("primitives6")
    done.press_folder("Search on from here")
    done.box("Seconds").fill("300")
    done.box("Programs at once").fill("16")
    done.press("Search on from this program")
    done.says("continue: ")  # evolve; a busy page may first hear of it when that has ended
    done.says("primitives7")  # a child has a hole where one is missing
    done.keys("x")  # on a busy machine it is good enough, and ends, before that
    done.says("ready")
    assert done.status("stage").startswith("continue: ")
    assert done.status("primitives") == "7", "what was found so far stays"
    done.box("Seconds").fill("60")
    done.press_folder("Search on from here")
    done.keys("Control+z")
    done.says("primitives6")
    done.keys("Control+z", "Escape")
    done.measures(EXACT)


def test_two_run_the_third_waits_and_a_closed_page_makes_room(done, phone, browser, server):
    leaving = LabPage(browser, server.url)
    for page in (phone, leaving):
        page.choose("Example", "Bracket, scanned")
        page.says("scanned")
        page.press("Start")
        page.says("running")
        page.press("Pause")  # it keeps its place, and leaves the core to the others
        page.says("paused")
    assert done.status("part") == "Bracket"
    done.select(1)
    done.tab("Edit")
    done.box("r mm").fill("13")
    done.press("Fit the numbers to the part")
    done.says("waiting for its turn, 0 before it")
    working = _workers(server.pid)
    leaving.close()
    done.notice("fitted: all relations hold")
    done.measures(EXACT)
    end = time.monotonic() + WAIT_MS / 1000
    while working <= _workers(server.pid):
        assert time.monotonic() < end, "the page is gone and its process works on"
        time.sleep(0.05)
    done.keys("Control+z", "Control+z", "Escape")
    done.tab("Run")
    assert phone.status("state") == "paused"


def test_a_killed_run_is_told_to_its_client_and_all_goes_on(done, phone, server):
    if phone.status("state") != "paused":  # it does after the test above
        phone.press("Step")
        phone.says("paused")
    for pid in _workers(server.pid):
        os.kill(pid, signal.SIGKILL)
    assert "the lab goes on" in phone.notice("SIGKILL")
    assert done.page.locator(".lab-notice", has_text="SIGKILL").count() == 0
    phone.choose("Example", "Knob")
    phone.says("Knob")
    phone.keys("r")
    phone.says("volume")
    phone.keys("x")
    phone.says("ready")


def _workers(server):
    """All processes that work for a server, those that wait too."""
    listed = subprocess.run(["ps", "-ww", "--ppid", str(server), "-o", "pid=,args="], capture_output=True, text=True, check=True).stdout
    return {int(line.split()[0]) for line in listed.splitlines() if "spawn_main" in line}
