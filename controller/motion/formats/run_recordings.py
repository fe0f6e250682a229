"""Recorded runs (.rec): the joint targets of `play --record` as a motion."""

from pathlib import Path

from controller.motion.clip import AS_FOUND, Clip, Format, ReadingOptions
from controller.motion.formats.taught_clip import taught_clip
from controller.wire.run_recording import MAGIC, RunRecording, load_recording
from motiondeck_base.errors import FileFormatError


def read_run(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The take of the targets of all joints, tick by tick."""
    options.refuse(path)
    recording = load_recording(Path(path))
    if recording.ticks == 0:
        raise FileFormatError(f"{path}: this recording holds no tick. Record a run that plays.")
    try:
        return clip_of_run(recording, Path(path).stem, Path(path).name)
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"{path}: its header lacks joints, rate or targets ({error}). Record it again.") from None


def clip_of_run(recording: RunRecording, name: str, source: str = "") -> Clip:
    """The clip of the targets of all joints; FileFormatError as `taught_clip`, KeyError where the header lacks them."""
    about = recording.description
    return taught_clip(name, list(about["joints"]), float(about["rate"]), recording.fields["targets"], source)


# Read by name only: a folder of recordings of people may hold runs too.
FORMAT = Format(suffixes=(".rec",), read=read_run, magic=MAGIC, matches=lambda _: False)
