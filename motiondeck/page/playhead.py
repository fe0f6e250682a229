"""The playhead: the place in a motion that a page shows; it plays, pauses, steps and can be dragged."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Playhead:
    """A place among T frames at a rate.

    Attributes:
        frames: T, at least 1.
        rate: frames per second, Hz.
        place: in frames, 0 to T - 1, between two of them while it plays.
        tempo: 1 is as recorded.
        playing: whether time passes.
    """

    frames: int
    rate: float
    place: float = 0.0
    tempo: float = 1.0
    playing: bool = True

    @property
    def frame(self) -> int:
        """The frame to show."""
        return min(int(self.place + 1e-9), self.frames - 1)

    @property
    def seconds(self) -> float:
        """Where it is, s."""
        return self.place / self.rate

    def advance(self, dt: float) -> None:
        """Lets dt seconds pass; after the last frame comes the first."""
        if self.playing:
            self.place = (self.place + dt * self.rate * self.tempo) % self.frames

    def step(self, frames: int) -> None:
        """Stops and goes some whole frames on, or back if negative; it holds at both ends."""
        self.playing = False
        self.place = float(min(max(self.frame + frames, 0), self.frames - 1))

    def seek(self, seconds: float) -> None:
        """Goes to a time, s, within the motion."""
        self.place = min(max(seconds * self.rate, 0.0), self.frames - 1.0)
