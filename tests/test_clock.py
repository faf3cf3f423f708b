"""A clock that is handed its time: what was cut short stays known."""

from imdim.clock import SEARCH_SHARE, Clock


def test_work_that_was_cut_short_is_late_and_a_search_that_was_is_cut():
    hands = [0.0]
    clock = Clock(100.0, now=lambda: hands[0])
    near, ending = clock.near_end(0.75), clock.ending_at(0.5)
    half = 0.5 * SEARCH_SHARE * 100.0  # of what the search may take
    hands[0] = half - 1.0
    assert not near()
    assert not ending()
    assert not clock.late
    hands[0] = half + 1.0
    assert ending()
    assert clock.late
    assert not clock.cut
    hands[0] = 76.0
    assert near()
    assert clock.out_of_time()
    assert clock.cut


def test_a_share_of_the_time_until_a_moment():
    hands = [0.0]
    clock = Clock(100.0, now=lambda: hands[0])
    hands[0] = 10.0
    half = clock.ending_at(0.5, 0.3)
    assert clock.left(0.3) == 20.0
    hands[0] = 19.0
    assert not half()
    hands[0] = 21.0
    assert half()
    assert clock.late
    hands[0] = 40.0
    assert clock.left(0.3) == 0.0
