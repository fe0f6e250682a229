"""Libraries of joint motions made up for tests: smooth loops and one-shots of a few joints."""

import numpy as np
from msgspec.structs import replace

from controller.learning.trainers.centralized import TRAINER, CentralizedRecipe
from controller.learning.training_set import TrainingSet
from controller.library.motion_library import VERSION, BakedFrom, LibraryInfo, MotionInfo, MotionLibrary
from controller.motion.encodings.joint_angles import JointAngles, JointBody
from controller.networks.clip.network import ClipPlayer

RATE = 120.0


def joint_library(joints=4, seed=0, loops=3, shots=2, network=ClipPlayer, lengths=None):
    """A library of a few seconds; some loops last whole hundredths of a second, the first lies behind a one-shot."""
    rng, frames, kinds = np.random.default_rng(seed), {}, {}
    for number in range(loops + shots):
        loop = number < loops
        name, length = (
            f"{'loop' if loop else 'shot'}{number}",
            int(rng.choice([120, 132, 150, 163, 180] if lengths is None else lengths[number : number + 1])),
        )
        phase = np.arange(length) * (2.0 * np.pi / length if loop else np.pi / (length - 1))
        waves = rng.normal(size=(3, joints, 2)) * np.array([0.3, 0.1, 0.03])[:, None, None]
        angles = sum(
            wave[:, 0] * np.cos((k + 1) * phase)[:, None] + wave[:, 1] * loop * np.sin((k + 1) * phase)[:, None]
            for k, wave in enumerate(waves)
        )
        frames[name], kinds[name] = angles + rng.normal(size=joints) * 0.2, loop
    encoding = JointAngles(JointBody.of([f"joint{number}" for number in range(joints)]))
    motions = [
        MotionInfo(
            name=name,
            plays="loop" if kinds[name] else "once",
            frames=len(part),
            source="",
            nrmse=0.0,
            error_mm=0.0,
            passed=True,
        )
        for name, part in frames.items()
    ]
    leaps = {one: {other: 2.0 * (other == "loop0" and kinds[one]) for other in frames} for one in frames}
    baked = BakedFrom(robot="", robot_digest="", library="", library_digest="", leaps=leaps)
    info = LibraryInfo(
        version=VERSION, name="made-up", network="clip", encoding=encoding.name, motions=motions, rate=RATE, seed=0,
        skeleton=encoding.skeleton_info(), recipe={}, licence="", acknowledgement="", baked=baked,
    )  # fmt: skip
    return MotionLibrary(info, network(frames, kinds), encoding)


def centralized_library(joints):
    """The same of two loops and a one-shot, learned by a centralized network."""
    made = joint_library(joints, loops=2, shots=1)
    frames = {name: made.network.anchors(name) for name in made.network.motions}
    lessons = TrainingSet(made.encoding, RATE, frames, {name: "loop" in name for name in frames}).lessons()
    network = TRAINER.train(CentralizedRecipe(iterations=5), lessons, 0)
    return MotionLibrary(replace(made.info, network="centralized"), network, made.encoding)
