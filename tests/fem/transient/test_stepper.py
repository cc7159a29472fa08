"""The stepper's lengths, pieces and ends, by a decay whose steps are Euler's."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import pytest

from tympan.fem.transient.ends import MESSAGES, Followed, Stopped, status_of
from tympan.fem.transient.stepper import StepControl, moments


@dataclass
class Decay:
    """ẏ = −(y − level), of a level for each piece; no step after ``until`` finds a balance."""

    levels: tuple[float, ...]
    until: float = math.inf
    reach: float = math.inf
    error: float = 1e-3
    saved: float | None = None
    time: float = 0.0
    value: float = 1.0
    level: float = 0.0
    ahead: tuple[float, float] = (0.0, 0.0)
    lengths: list[float] = field(default_factory=list)

    @property
    def control(self) -> StepControl:
        return StepControl(self.error, 2, 0.9, 1e-4)

    @property
    def gone(self) -> bool:
        return abs(self.value) > self.reach

    def enter(self, piece: int, begin: float, end: float
              ) -> tuple[list[tuple[float, float]], float | None]:
        assert begin == self.time
        self.level = self.levels[piece]
        return [(self.time, self.value)], 0.01 if piece == 0 else None

    def attempt(self, duration: float, end: float | None) -> float:
        after = self.time + duration if end is None else end
        if after > self.until:
            return math.inf
        moved = (self.value - self.level) / (1 + duration)
        self.ahead, away = (after, self.level + moved), (self.value - self.level)
        self.lengths.append(duration)
        return abs(away * math.exp(-duration) - moved)

    def accept(self) -> list[tuple[float, float]]:
        self.time, self.value = self.ahead
        return [self.ahead]

    def recover(self, shortest: bool) -> list[tuple[float, float]]:
        if not shortest:
            return []
        if self.saved is None:
            raise Stopped("pull_in", self.time)
        self.value, self.saved, self.until = self.saved, None, math.inf
        return [(self.time, self.value)]


def test_pieces_end_where_they_do_and_begin_with_their_time_again() -> None:
    when, values = zip(*moments(Decay((0.0, 2.0)), [0.0, 1.0, 2.5]), strict=True)
    assert [time for time in when if list(when).count(time) > 1] == [1.0, 1.0]
    assert (when[0], when[-1]) == (0.0, 2.5)
    assert values[-1] == pytest.approx(2 - (2 - math.exp(-1)) * math.exp(-1.5), abs=0.05)


def test_steps_are_as_long_as_the_error_allows() -> None:
    """A smaller error of a second-order rule by the root of it, steps to an end alike."""
    counts = [len(list(moments(Decay((0.0,), error=error), [0.0, 3.0])))
              for error in (1e-4, 1e-6)]
    assert counts[1] == pytest.approx(10 * counts[0], rel=0.15)
    lengths = (decay := Decay((0.0,), error=1e-5), list(moments(decay, [0.0, 3.0])))[0].lengths
    assert lengths[-1] == pytest.approx(lengths[-2], rel=1e-9)  # the last two share the rest


def test_a_motion_without_a_way_on_stops_near_where_it_has_none() -> None:
    followed = Followed(moments(Decay((0.0,), until=0.7), [0.0, 3.0]))
    reached = list(followed)
    assert followed.stopped is not None
    assert reached[-1][0] == followed.stopped.time == pytest.approx(0.7, abs=1e-4)
    assert status_of(followed.stopped) == "pull_in"


def test_another_way_is_gone_where_there_is_one() -> None:
    followed = Followed(moments(Decay((0.0,), until=0.7, saved=0.1), [0.0, 3.0]))
    reached = list(followed)
    assert followed.stopped is None
    assert status_of(followed.stopped) == "done"
    assert reached[-1][1] == pytest.approx(0.1 * math.exp(-2.3), abs=0.02)


def test_a_plate_beyond_its_reach_is_gone() -> None:
    followed = Followed(moments(Decay((9.0,), reach=5.0), [0.0, 3.0]))
    *_, (time, value) = followed
    assert followed.stopped is not None
    assert (followed.stopped.kind, followed.stopped.time) == ("pull_in", time)
    assert 5.0 < value < 5.5


def test_each_end_has_its_words() -> None:
    for kind, words in MESSAGES.items():
        assert str(Stopped(kind, 1.5)) == words.format(time=1.5)
        assert "1.5 s" in words.format(time=1.5)
    assert str(Stopped("pull_in", 1.5, "the table ends")) == "the table ends, after 1.5 s"
