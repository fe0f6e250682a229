"""Animations in glTF 2.0 files (.gltf, .glb) and VRM files, which are glTF with named human bones (.vrm, .vrma).

A file is JSON: nodes, each with a translation, rotation and scale relative to its parent, and animations, whose
channels drive these between keyframes (glTF 2.0 specification, 3.11 and appendix C). The numbers are in buffers
(`gltf_buffers`). The body is the joints of skins, of VRM's humanoid, or else the animated nodes, with all ancestors. An
animation is sampled at the rate of its keyframes; of several animations the longest is read. y is up, and a length is
1 m unless the size of the body says otherwise: many exporters leave centimetres.
"""

from pathlib import Path

import numpy as np

from controller.motion import rotations
from controller.motion.canonical.clip_edits import cubic
from controller.motion.clip import AS_FOUND, Clip, Format, ReadingOptions
from controller.motion.formats.gltf_buffers import Accessors, Animation, Asset, Sampler, open_gltf
from controller.motion.joint_tree import MOST_POSES, JointTree, chosen_person, clip_of, distinct, people_in
from controller.motion.rotations import Array, conjugate, dot, multiply, normalise, rotate
from motiondeck_base.errors import FileFormatError

SLOWEST, FASTEST = 30.0, 240.0  # Hz: sparse and dense keyframes are sampled within these
LONGEST = 86400.0  # s
SAME = 1e-5  # s: keys are float32, so a sample at a key may come out just before it


def read_gltf(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The longest animation in a glTF or VRM file."""
    asset, accessors = open_gltf(path)
    parents = _parents(path, asset)
    if not asset.animations:
        raise FileFormatError(f"{path}: there is no animation in it, only a model. Export it with its animation.")
    found = (_tracks(path, asset, accessors, animation) for animation in asset.animations)
    tracks = max(found, key=lambda tracks: max((float(track.keys[-1]) for track in tracks), default=-1.0))
    if not tracks:
        raise FileFormatError(f"{path}: its animations move no node. Export it with its animation.")
    begin = min(float(track.keys[0]) for track in tracks)
    seconds = max(float(track.keys[-1]) for track in tracks) - begin
    steps = np.concatenate([np.diff(track.keys) for track in tracks])
    steps = steps[steps > 0.0]
    rate = float(np.clip(1.0 / np.median(steps), SLOWEST, FASTEST)) if len(steps) else SLOWEST
    rate = round(rate) if abs(rate - round(rate)) < 0.01 * rate else rate
    frames = int(seconds * rate + 1e-3) + 1
    human = _human_bones(asset)
    joints = _joints(asset, parents, human, {track.node for track in tracks})
    place = {node: index for index, node in enumerate(joints)}
    names = [asset.nodes[node].name or f"node {node}" for node in joints]
    if len(people := people_in(names, [place.get(parents[node], -1) for node in joints])) > 1:
        joints = [joints[one] for one in people[chosen_person(path, people, options.person)]]
    if frames * len(joints) > MOST_POSES:
        raise FileFormatError(f"{path}: {seconds:.0f} s of {len(joints)} joints do not fit into memory. Export a part.")
    return clip_of(_posed(asset, parents, joints, human, tracks, begin + np.arange(frames) / rate), rate, path, options)


class _Track:
    """One channel of an animation: the keys (K,), s, of a node's translation, rotation or scale, and its values."""

    def __init__(
        self, path: str | Path, asset: Asset, accessors: Accessors, node: int, kind: str, sampler: Sampler
    ) -> None:
        self.node, self.kind, self._interpolation = node, kind, sampler.interpolation
        width = 4 if kind == "rotation" else 3
        self.keys = accessors.numbers(sampler.input, 1)[:, 0]
        values = accessors.numbers(sampler.output, width)
        tripled = 3 if self._interpolation == "CUBICSPLINE" else 1
        if len(self.keys) == 0 or len(values) != tripled * len(self.keys) or (np.diff(self.keys) < 0.0).any():
            raise FileFormatError(f"{path}: keyframes of {asset.called(node)} are broken. Export it again.")
        if not 0.0 <= self.keys[-1] - self.keys[0] <= LONGEST:
            raise FileFormatError(f"{path}: keyframes of {asset.called(node)} lie more than a day apart.")
        self._values = values.reshape(-1, tripled, width)

    def at(self, times: Array) -> Array:
        """The values at times (T,), s; constant before the first and after the last key (appendix C)."""
        keys, values = self.keys, self._values
        times = np.clip(times, keys[0], keys[-1])
        low = np.clip(np.searchsorted(keys, times + SAME, side="right") - 1, 0, max(len(keys) - 2, 0))
        high = np.minimum(low + 1, len(keys) - 1)
        span = keys[high] - keys[low]
        share = np.clip((times - keys[low]) / np.where(span > 0.0, span, 1.0), 0.0, 1.0)[:, None]
        if self._interpolation == "STEP":
            return values[np.where(share[:, 0] < 1.0, low, high), 0]
        if self._interpolation == "CUBICSPLINE":
            out_of, into = values[low, 2] * span[:, None], values[high, 0] * span[:, None]
            return cubic(values[low, 1], out_of, values[high, 1], into, share)
        start, end = values[low, 0], values[high, 0]
        if self.kind != "rotation":
            return start + share * (end - start)
        start, end = normalise(start[:, [3, 0, 1, 2]]), normalise(end[:, [3, 0, 1, 2]])
        end = np.where(dot(start, end)[:, None] < 0.0, -end, end)
        turn = share * rotations.to_rotation_vector(multiply(conjugate(start), end))
        return multiply(start, rotations.from_rotation_vector(turn))[:, [1, 2, 3, 0]]


def _tracks(path: str | Path, asset: Asset, accessors: Accessors, animation: Animation) -> list[_Track]:
    found: list[_Track] = []
    for channel in animation.channels:
        node, kind = channel.target.node, channel.target.path
        if node is None or kind not in ("translation", "rotation", "scale"):
            continue  # weights of shapes, and pointers of extensions
        if not 0 <= channel.sampler < len(animation.samplers):
            raise FileFormatError(f"{path}: an animation names sampler {channel.sampler}, which it lacks.")
        found.append(_Track(path, asset, accessors, node, kind, animation.samplers[channel.sampler]))
    return found


def _parents(path: str | Path, asset: Asset) -> list[int]:
    parents = [-1] * len(asset.nodes)
    for index, node in enumerate(asset.nodes):
        for child in node.children:
            if parents[child] != -1 or child == index:
                raise FileFormatError(f"{path}: {asset.called(child)} has two parents. Export it again.")
            parents[child] = index
    for index in range(len(parents)):
        above, steps = index, 0
        while above != -1:
            above, steps = parents[above], steps + 1
            if steps > len(parents):
                raise FileFormatError(f"{path}: {asset.called(index)} is its own ancestor. Export it again.")
    return parents


def _human_bones(asset: Asset) -> dict[int, str]:
    """VRM's human bone of each node, such as "leftUpperLeg"."""
    named: dict[int, str] = {}
    for extension in ("VRMC_vrm", "VRMC_vrm_animation", "VRM"):
        bones = _inside(_inside(asset.extensions.get(extension), "humanoid"), "humanBones")
        if isinstance(bones, dict):  # VRM 1.0
            pairs = [(name, _inside(bone, "node")) for name, bone in bones.items()]
        else:  # VRM 0.x
            listed = bones if isinstance(bones, list) else []
            pairs = [(_inside(bone, "bone"), _inside(bone, "node")) for bone in listed]
        for name, node in pairs:
            if isinstance(name, str) and isinstance(node, int) and 0 <= node < len(asset.nodes):
                named.setdefault(node, name)
    return named


def _inside(value: object, key: str) -> object:
    return value.get(key) if isinstance(value, dict) else None


def _joints(asset: Asset, parents: list[int], human: dict[int, str], driven: set[int]) -> list[int]:
    """The nodes of the body, parents first: its joints and their ancestors."""
    kept: set[int] = set()
    for node in {joint for skin in asset.skins for joint in skin.joints} | set(human) or driven:
        while node != -1 and node not in kept:
            kept.add(node)
            node = parents[node]

    def depth(node: int) -> int:
        return 0 if parents[node] == -1 else 1 + depth(parents[node])

    return sorted(kept, key=lambda node: (depth(node), node))


def _posed(
    asset: Asset, parents: list[int], joints: list[int], human: dict[int, str], tracks: list[_Track], times: Array
) -> JointTree:
    index = {node: place for place, node in enumerate(joints)}
    frames = len(times)
    position = np.zeros((frames, len(joints), 3))
    rotation = np.zeros((frames, len(joints), 4))
    shape: list[Array] = []  # of each joint, its scale times its ancestors', shape (T, 1)
    for place, node in enumerate(joints):
        moved = {track.kind: track for track in tracks if track.node == node}
        where, turn, scale = asset.nodes[node].pose()
        where = moved["translation"].at(times) if "translation" in moved else np.broadcast_to(where, (frames, 3))
        turn = moved["rotation"].at(times) if "rotation" in moved else np.broadcast_to(turn, (frames, 4))
        scale = moved["scale"].at(times) if "scale" in moved else np.broadcast_to(scale, (frames, 3))
        turn = normalise(turn[:, [3, 0, 1, 2]])
        turn[dot(turn, turn) < 0.5] = [1.0, 0.0, 0.0, 0.0]
        above = index.get(parents[node], -1)
        if above == -1:
            position[:, place], rotation[:, place] = where, turn
            shape.append(scale[:, :1])
        else:
            # Scales of bodies are alike along all axes; of others the mean is taken.
            position[:, place] = position[:, above] + rotate(rotation[:, above], where * shape[above])
            rotation[:, place] = multiply(rotation[:, above], turn)
            shape.append(shape[above] * np.cbrt(np.abs(scale.prod(axis=1, keepdims=True))))
    names = distinct(human.get(node) or asset.nodes[node].name or f"node {node}" for node in joints)
    above = [index.get(parents[node], -1) for node in joints]
    if above.count(-1) > 1:
        names, above = ["scene", *names], [-1, *(1 + joint for joint in above)]
        position = np.concatenate([np.zeros((frames, 1, 3)), position], axis=1)
        rotation = np.concatenate([np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1, 1)), rotation], axis=1)
    return JointTree(tuple(names), np.array(above), position, rotation, np.ones(len(names), dtype=np.bool_))


FORMAT = Format(suffixes=(".gltf", ".glb", ".vrm", ".vrma"), read=read_gltf, magic=b"glTF")
