"""A recognizer of clips and poses, whose verdict may be "unknown", and its file: checked, nothing executed."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import msgspec
import numpy as np

from controller.learning.recognition.experts import ExpertBank, ExpertRecipe, ModelSpace, Moments, moments, teach
from controller.learning.recognition.features import FeatureRecipe, features, still_features, with_velocity
from controller.learning.recognition.labelled_recordings import Dataset, inner_folds
from controller.learning.recognition.online_recognizer import FrameTimes, OnlineRecognizer
from controller.motion.clip import Clip
from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton
from controller.networks.reservoirs.reservoir import Reservoir
from motiondeck_base.arrays_file import Kind, read_arrays, write_arrays
from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.toml_file import shaped

# Shares in the training set: known motions of a new actor called unknown; with one actor only, unlearned motions of
# that actor called known.
FALSE_REJECTIONS = 0.05
FALSE_ACCEPTANCES = 0.5
LEAST_CONFIDENCE = -1e3  # below every confidence
SHORTEST_STRETCH, LONGEST_STRETCH = 0.1, 10.0
STEADY = 0.06  # s for which a verdict must be constant before it is reported

VERSION = 3
OLDER = (1, 2)  # both without a model space; in 1 yy is a sum over the channels
KEY = "motiondeck recognizer"
KIND = Kind("recognizer", KEY, VERSION, "`motiondeck recognize train`", OLDER)


@dataclass(frozen=True)
class RecognitionVerdict:
    """The classification of a motion."""

    motion: str  # the nearest class
    known: bool  # whether the experts' confidence reaches the threshold
    margin: float  # difference between the second-least and the least cost
    costs: dict[str, float]  # the centred log error of each class, less the model space's vote for it


@dataclass(frozen=True, eq=False)
class Recognizer:
    """A trained recognizer."""

    recipe: FeatureRecipe  # of its features, with explicit joints
    bank: ExpertBank
    threshold: float  # the confidence (`ExpertBank.confidences`) below which a motion is called unknown
    clips: int  # number of training clips
    sources: tuple[str, ...] = ()  # names of their files
    models: ModelSpace | None = None  # None in older files

    def recognize(self, clip: Clip) -> RecognitionVerdict:
        """The verdict on a clip; MotiondeckError if it lacks a joint, or is too short to predict anything."""
        return self.verdict_on(self.features(clip))

    def verdict_on(self, signal: Array) -> RecognitionVerdict:
        """The verdict on the features of a clip, shape (T, C)."""
        forced = self.bank.force([signal])
        errors = self.bank.costs(forced)[0]
        if self.models is None:
            return self.verdict(errors, errors)
        return self.verdict(errors, errors - self.models.votes([moments(forced[0])], self.bank.recipe)[0])

    def features(self, clip: Clip) -> Array:
        """The features of a clip, shape (T, C), T >= 2; errors as `recognize`."""
        signal = features(clip, self.recipe)
        if len(signal) < 2:
            raise MotiondeckError(
                f"{clip.source or clip.name}: {len(clip)} frames at {clip.rate:g} Hz are too short to be recognized "
                f"(at least {2.0 / self.recipe.rate:.2f} s). Give a longer recording."
            )
        return signal

    def verdict(self, errors: Array, costs: Array) -> RecognitionVerdict:
        """The verdict on the experts' centred log errors, which say whether it is known, and on costs, both (M,)."""
        named = dict(zip(self.bank.classes, costs.tolist(), strict=True))
        known = float(self.bank.confidences(errors[None])[0]) >= self.threshold
        least, second = sorted(named.values())[:2]
        return RecognitionVerdict(self.bank.classes[int(costs.argmin())], known, second - least, named)


def train_recognizer(
    dataset: Dataset, look: FeatureRecipe, experts: ExpertRecipe, stretches: Sequence[float] = (1.0,)
) -> Recognizer:
    """A recognizer of the classes of a dataset, with a copy of each clip for each factor `stretches` on its duration.

    MotiondeckError if there are fewer than two classes, a clip lacks a joint the features need, or a stretch is not
    between SHORTEST_STRETCH and LONGEST_STRETCH.
    """
    for stretch in stretches:
        if not SHORTEST_STRETCH <= stretch <= LONGEST_STRETCH:
            raise MotiondeckError(f"a stretch of {stretch:g}: give {SHORTEST_STRETCH:g} to {LONGEST_STRETCH:g}")
    if len(dataset.classes) < 2:
        there = f"there is only one class, '{dataset.classes[0]}'" if dataset.classes else "there is no class"
        raise MotiondeckError(f"{there}; a recognizer needs two folders or more.")
    look = look.for_clips([example.clip for example in dataset.examples])
    signals = [[features(example.clip, look, stretch) for stretch in stretches] for example in dataset.examples]
    short = [e.path for e, own in zip(dataset.examples, signals, strict=True) if min(map(len, own)) < 2]
    if short:
        raise MotiondeckError(f"{short[0]}: too short for {look.rate:g} Hz features. Remove it, or raise --rate.")
    bank = _trained_bank(signals, range(len(signals)), dataset, experts)
    threshold = rejection_threshold(signals, dataset, experts)
    sources = tuple(example.path.name for example in dataset.examples)
    every = bank.force([signal for own in signals for signal in own])
    labels = np.repeat(dataset.labels, len(stretches)).tolist()
    models = ModelSpace.fit([moments(one) for one in every], labels, bank.costs(every), experts)
    return Recognizer(look, bank, threshold, len(signals), sources, models)


def _trained_bank(
    signals: list[list[Array]], learn: Iterable[int], dataset: Dataset, experts: ExpertRecipe
) -> ExpertBank:
    pairs = [(signal, dataset.examples[i].label) for i in learn for signal in signals[i]]
    return teach(experts, [signal for signal, _ in pairs], [label for _, label in pairs])


def rejection_threshold(signals: list[list[Array]], dataset: Dataset, experts: ExpertRecipe) -> float:
    """The confidence below which a motion is called unknown, by cross-validation."""
    # With several actors it is the FALSE_REJECTIONS quantile over all clips, tested on experts that were trained
    # without their actor. With one actor it rejects all but FALSE_ACCEPTANCES of the clips, tested on experts trained
    # without their class. LEAST_CONFIDENCE, which rejects nothing, if the set is too small to be split.

    def seen(learn: Iterable[int], ask: Iterable[int]) -> Array:
        bank = _trained_bank(signals, learn, dataset, experts)
        return bank.confidences(bank.costs(bank.force([signal for i in ask for signal in signals[i]])))

    labels = dataset.labels
    if len(np.unique(dataset.actors)) == 1 and len(dataset.classes) > 2:
        splits = [(np.flatnonzero(labels != c), np.flatnonzero(labels == c)) for c in range(len(dataset.classes))]
        share = 1.0 - FALSE_ACCEPTANCES
    else:
        share = FALSE_REJECTIONS
        try:
            splits = inner_folds(labels, dataset.actors)
        except MotiondeckError:
            return LEAST_CONFIDENCE
    return float(np.quantile(np.concatenate([seen(learn, ask) for learn, ask in splits]), share))


class RecognizerInfo(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The header of a recognizer; fields as in `Recognizer`, and the licence of the recordings, if given."""

    version: int
    classes: list[str]
    features: FeatureRecipe
    experts: ExpertRecipe
    threshold: float
    clips: int
    sources: list[str]
    licence: str = ""


def save_recognizer(recognizer: Recognizer, path: Path, licence: str = "") -> None:
    """Writes a recognizer atomically; FileFormatError if the folder cannot be written."""
    bank = recognizer.bank
    info = RecognizerInfo(
        version=VERSION,
        classes=list(bank.classes),
        features=recognizer.recipe,
        experts=bank.recipe,
        threshold=recognizer.threshold,
        clips=recognizer.clips,
        sources=list(recognizer.sources),
        licence=licence,
    )
    arrays: dict[str, Array] = {name: getattr(bank.reservoir, name) for name in ("weights", "input_weights", "bias")}
    arrays |= {name: np.array([getattr(of, name) for of in bank.moments]) for name in ("xx", "xy", "yy", "count")}
    if recognizer.models is not None:
        arrays |= {"model_weights": recognizer.models.weights, "model_offset": recognizer.models.offset}
    write_arrays(path, KIND, info, arrays)


def load_recognizer(path: Path) -> Recognizer:
    """Reads and checks a recognizer; FileFormatError is one line that names the file and the error."""
    header, stored = read_arrays(path, KIND)
    info = _read_info(path, header)
    classes, neurons, channels = len(info.classes), info.experts.neurons, stored.size("input_weights", axis=1)
    take = partial(stored.take, kind=np.float64)
    weights, inputs = take("weights", neurons, neurons), take("input_weights", neurons, channels)
    reservoir = Reservoir(weights, inputs, take("bias", neurons), info.experts.leak)
    xx, xy = take("xx", classes, neurons, neurons), take("xy", classes, neurons, channels)
    count = take("count", classes)
    if info.version == 1:
        yy = np.tile(take("yy", classes)[:, None] / channels, channels)
    else:
        yy = take("yy", classes, channels)
    models: ModelSpace | None = None
    if info.version > 2:
        read = neurons // info.experts.groups * info.experts.groups
        weights = stored.take("model_weights", classes, read * channels)
        models = ModelSpace(weights, take("model_offset", classes))
    stored.finish()
    if (count <= 0.0).any() or (yy < 0.0).any():
        raise FileFormatError(f"{path}: a class was trained on nothing")
    parts = tuple(Moments(xx[m], xy[m], yy[m], float(count[m])) for m in range(classes))
    bank = ExpertBank(info.experts, reservoir, tuple(info.classes), parts)
    try:
        usable = bool(np.isfinite(bank.readouts).all() and np.isfinite(bank.centre).all())
    except np.linalg.LinAlgError:
        usable = False
    if not usable:
        raise FileFormatError(f"{path}: its moments are not those of any motion. Train it again.")
    return Recognizer(info.features, bank, info.threshold, info.clips, tuple(info.sources), models)


def _read_info(path: Path, tree: object) -> RecognizerInfo:
    try:
        info = shaped(tree, RecognizerInfo, f"{path} (header)")
    except MotiondeckError as error:
        raise error if isinstance(error, FileFormatError) else FileFormatError(f"{path} (header): {error}") from None
    if len(info.classes) < 2 or len(set(info.classes)) < len(info.classes):
        raise FileFormatError(f"{path}: its header names fewer than two classes, or one twice")
    if not (np.isfinite(info.threshold) and abs(info.threshold) <= -LEAST_CONFIDENCE):
        raise FileFormatError(f"{path}: a threshold of {info.threshold} is impossible")
    return info


class BodyRecognizer:
    """Recognizes the motion of a body of B bones with a recognizer trained on recordings of any bodies.

    `online` has the verdict of the last frame, and `seen` the motion that has been the verdict for STEADY seconds, or
    None. MotiondeckError if the skeleton lacks a joint of the recognizer's features.
    """

    def __init__(self, recognizer: Recognizer, skeleton: Skeleton) -> None:
        self._recipe, self._skeleton = recognizer.recipe, skeleton
        self.online = OnlineRecognizer(recognizer.bank, recognizer.threshold, recognizer.recipe.rate)
        self._times = FrameTimes(recognizer.recipe.rate)
        self._frame: Array | None = None
        self._root, self._rotation = np.zeros((2, 3)), np.zeros((2, 1 + len(skeleton), 4))
        self._rotation[..., 0] = 1.0
        self._still()  # names a joint that is missing, before anything moves
        self._verdict: str | None = None
        self._steady = 0.0
        self.seen: str | None = None

    def update(self, root_position: Array, rotation: Array, dt: float) -> str | None:
        """Processes the pose dt >= 0 seconds after the last one and returns `seen`.

        `rotation` is that of the root and of each bone in the world, shape (1 + B, 4), `root_position` in m. Frames for
        the experts are interpolated linearly. A pose that is not finite is skipped with its time.
        """
        if not (np.isfinite(root_position).all() and np.isfinite(rotation).all()):
            self.online.skipped += 1
            return self.seen
        self._root[0], self._rotation[0] = self._root[1], self._rotation[1]
        self._root[1], self._rotation[1] = root_position, rotation
        if self._frame is None:
            self._take(self._still()[1])
            return self.seen
        still: Array | None = None
        for share in self._times.due(dt):
            if still is None:
                still = self._still()
            self._take((1.0 - share) * still[0] + share * still[1])
        return self.seen

    def _still(self) -> Array:
        """The features of the last pose and this one, without velocities, shape (2, C)."""
        return still_features(Clip("now", self._skeleton, 1.0, self._root, self._rotation), self._recipe)

    def _take(self, frame: Array) -> None:
        before = self._frame if self._frame is not None else frame
        self._frame = frame
        if self._recipe.velocity:
            frame = with_velocity(np.stack([before, frame]), self._recipe.rate)[1]
        self.online.update(frame)
        verdict = self.online.motion if self.online.known else None
        self._steady = self._steady + 1.0 / self._recipe.rate if verdict == self._verdict else 0.0
        self._verdict = verdict
        self.seen = verdict if self._steady >= STEADY else None
