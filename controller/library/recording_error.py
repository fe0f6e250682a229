"""How far a motion's free run is from its recording, as the header of a library has it."""

import msgspec

LARGEST_MM, LARGEST_DEGREES = 40.0, 5.0  # 95 % of the errors of a motion that passes, mm on its own body, are smaller
LARGEST_HELD = 5.0  # degrees of any bone

# Landmarks in words, after "left" or "right" where the name begins with l or r.
_WORDS = {"hip": "hip", "kne": "knee", "ank": "ankle", "foo": "toes"}
_WORDS |= {"sho": "shoulder", "elb": "elbow", "wri": "wrist", "han": "hand"}


class Errors(msgspec.Struct, frozen=True, kw_only=True):
    """Errors over all frames and joints (mm), or all frames and bones (degrees)."""

    median: float
    p95: float
    worst: float
    joint: str  # of the canonical body, where the worst is
    worst_at_s: float  # when it is, in the recording, s

    @property
    def where(self) -> str:
        """Joint and time of the worst, in words."""
        side, name = {"l": "left ", "r": "right "}.get(self.joint[:1], ""), self.joint[1:]
        joint = side + _WORDS[name] if name in _WORDS else {"back": "waist"}.get(self.joint, self.joint)
        return f"{joint} at {self.worst_at_s:.2f} s"


class RecordingError(msgspec.Struct, frozen=True, kw_only=True):
    """The error of a finished library's free run against the recording, before that was prepared for learning."""

    from_s: float  # learned part of the recording, s
    to_s: float
    mm: Errors
    degrees: Errors
    own_body_mm: float  # 95 % of the errors, mm, on the lengths of the recording's own body
    held_degrees: float | None = None  # largest angle of a bone between the held and the last recorded pose; one-shots
    # Of feet that stand: how much higher than recorded they are (95 %), and how far they are from their mean place
    # (95 %), played and recorded; None where none stands.
    floor_mm: float | None = None
    slide_mm: float | None = None
    recorded_slide_mm: float | None = None

    @property
    def words(self) -> str:
        """The errors as a sentence's end."""
        return (
            f"within {self.mm.p95:.0f} mm and {self.degrees.p95:.1f}° of its recording in 95 % of frames and joints "
            f"(worst {self.mm.worst:.0f} mm, {self.mm.where})"
        )

    @property
    def reason(self) -> str:
        """Why a motion with these errors does not pass, or ""."""
        far = "too far from its recording"
        if not self.own_body_mm <= LARGEST_MM:
            allowed = f"95 % within {self.own_body_mm:.0f} mm, {LARGEST_MM:g} mm are allowed"
            return f"{far}: {allowed}; the worst is {self.mm.worst:.0f} mm, {self.mm.where}"
        if not self.degrees.p95 <= LARGEST_DEGREES:
            allowed = f"95 % within {self.degrees.p95:.1f}°, {LARGEST_DEGREES:g}° are allowed"
            return f"{far}: {allowed}; the worst is {self.degrees.worst:.0f}°, {self.degrees.where}"
        if self.held_degrees is not None and not self.held_degrees <= LARGEST_HELD:
            return f"holds a pose {self.held_degrees:.0f}° from the last recorded one, {LARGEST_HELD:g}° are allowed"
        return ""
