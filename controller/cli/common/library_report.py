"""What a library holds: a table for people, and plain values for scripts."""

from __future__ import annotations

from controller.library.motion_library import MotionLibrary


def report(library: MotionLibrary) -> dict[str, object]:
    """What a library holds, for scripts."""
    import msgspec

    info = library.info
    return {
        "name": info.name,
        "network": info.network,
        "neurons": library.network.neurons,
        "rate_hz": info.rate,
        "seed": info.seed,
        "skeleton": info.skeleton.name,
        "bones": len(info.skeleton.bones),
        "motions": [msgspec.to_builtins(motion) for motion in info.motions],
        "licence": info.licence,
        "acknowledgement": info.acknowledgement,
    }


def print_table(library: MotionLibrary) -> None:
    """One row a motion: what it was learned from and how its free run went."""
    from controller.cli.common.tables import show_table

    info = library.info
    error = "free run, mrad" if info.encoding == "joint angles" else "free run, mm"
    rows = [
        (
            motion.name,
            motion.plays,
            f"{motion.frames / info.rate:.2f}",
            f"{motion.nrmse:.4f}",
            f"{motion.error_mm:.1f}",
            "[green]passed[/]" if motion.passed else f"[red]failed[/]: {motion.reason}",
        )
        for motion in info.motions
    ]
    show_table(
        ("motion", "plays", "seconds", "NRMSE", error, "self-test"),
        rows,
        title=f"{info.name}: {info.network}, {library.network.neurons} neurons, {info.rate:g} Hz",
        left=("plays", "self-test"),
    )
