"""Humanoids written at random: sizes, weights, orders of hinges, feet and servos of a seed."""

from __future__ import annotations

import numpy as np

_AXES = {"yaw": "0 0 1", "roll": "1 0 0", "pitch": "0 1 0"}


def random_humanoid(seed: int) -> str:
    """An MJCF, 0.45 to 1.8 m tall, with position servos that are strong and stiff, or not."""
    random = np.random.default_rng(seed)
    tall = random.uniform(0.45, 1.8)
    leg = tall * random.uniform(0.44, 0.53)
    ankle = tall * random.uniform(0.03, 0.05)
    thigh = (leg - ankle) * random.uniform(0.45, 0.55)
    shank = leg - ankle - thigh
    apart, sole, wide = (tall * random.uniform(*ends) for ends in ((0.045, 0.07), (0.055, 0.085), (0.022, 0.035)))
    ahead, rolls = sole * random.uniform(0.1, 0.5), random.random() < 0.85
    orders = [" ".join(random.permutation(["yaw", "roll", "pitch"])) for _ in range(2)]
    mass = random.uniform(9.0, 25.0) * tall**3  # a human has 14, a small robot of servos 25 kg / m^3
    # Torque and stiffness in shares of weight times height.
    strong, stiff = (9.81 * mass * tall * random.uniform(*ends) for ends in ((0.06, 0.4), (1.0, 8.0)))
    servos: list[str] = []

    def hinges(prefix: str, kinds: str, ends: dict[str, str]) -> str:
        text = ""
        for kind in kinds.split():
            name = f"{prefix}_{kind}"
            servos.append(
                f'<position name="{name}" joint="{name}" kp="{stiff:g}" kv="{0.03 * stiff:g}" '
                f'forcerange="{-strong:g} {strong:g}"/>'
            )
            text += f'<joint name="{name}" axis="{_AXES[kind]}" range="{ends.get(kind, "-2 2")}"/>'
        return text

    def capsule(length: float, radius: float) -> str:
        return f'<geom type="capsule" fromto="0 0 0 0 0 {-length:g}" size="{radius * tall:g}"/>'

    limbs = ""
    for side, left in (("left", 1), ("right", -1)):
        hip = hinges(f"{side}_hip", orders[0], {"pitch": "-2.2 1.2", "roll": "-.8 .8", "yaw": "-1 1"})
        knee = hinges(f"{side}_knee", "pitch", {"pitch": "0 2.5"})
        foot = hinges(f"{side}_ankle", "pitch roll" if rolls else "pitch", {"pitch": "-1.1 .9", "roll": "-.5 .5"})
        arm = hinges(f"{side}_shoulder", orders[1], {"pitch": "-3 2", "roll": "-2.5 2.5"})
        elbow = hinges(f"{side}_elbow", "pitch", {"pitch": "-2.4 0"})
        limbs += (
            f'<body name="{side}_thigh" pos="0 {left * apart:g} {-0.02 * tall:g}">{hip}{capsule(thigh, 0.035)}'
            f'<body name="{side}_shank" pos="0 0 {-thigh:g}">{knee}{capsule(shank, 0.025)}'
            f'<body name="{side}_foot" pos="0 0 {-shank:g}">{foot}<geom type="box" pos="{ahead:g} 0 {-0.75 * ankle:g}" '
            f'size="{sole:g} {wide:g} {0.25 * ankle:g}"/></body></body></body>'
            f'<body name="{side}_upper" pos="0 {left * 0.12 * tall:g} {0.27 * tall:g}">{arm}'
            f"{capsule(0.15 * tall, 0.02)}"
            f'<body name="{side}_fore" pos="0 0 {-0.17 * tall:g}">{elbow}{capsule(0.14 * tall, 0.017)}</body></body>'
        )
    return (
        f'<mujoco model="random{seed}"><compiler angle="radian" autolimits="true" settotalmass="{mass:g}"/>'
        f'<default><joint armature="{0.002 * mass * tall**2:g}"/></default><worldbody>'
        f'<body name="pelvis" pos="0 0 {leg + 0.02 * tall:g}">'
        f'<freejoint/><geom type="box" size="{0.05 * tall:g} {0.08 * tall:g} {0.03 * tall:g}"/>'
        f'<geom type="box" pos="0 0 {0.18 * tall:g}" size="{0.045 * tall:g} {0.09 * tall:g} {0.11 * tall:g}"/>'
        f'<geom pos="0 0 {0.38 * tall:g}" size="{0.06 * tall:g}"/>{limbs}</body></worldbody>'
        f"<actuator>{''.join(servos)}</actuator></mujoco>"
    )
