"""A robot walks on its own feet and is pushed; whether it fell is known in the end.

Its root is free: nothing holds it but the ground. The body follows commands 1.2 s later, because steps are planned
ahead.

python examples/push_and_walk.py --impulse 0.25
"""

import argparse
import time

import motiondeck


def play_until(deck: motiondeck.LiveDeck, seconds: float) -> None:
    """Waits until so much of the motion was played; the deck's clock starts when the first pose is reached."""
    while deck.running and deck.status().at < seconds:
        time.sleep(0.05)


def main() -> None:
    """Walks, pushes the body from the left and reports how far it came."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--impulse", type=float, default=0.15, help="N s")
    options = parser.parse_args()

    with motiondeck.play("thesis15", "walk", robot="servo20", root="free", walk=True) as deck:
        play_until(deck, options.seconds / 2.0)
        deck.push("left", options.impulse)
        play_until(deck, options.seconds)
        fallen = deck.status().fallen
    travel = deck.wait()["outputs"][0]["travel"]
    print(f"pushed with {options.impulse:g} N s, and it {'fell' if fallen else 'still stands'}")
    print(f"walked {travel['walked_m']:.1f} m; the motion went {travel['asked_m']:.1f} m")


if __name__ == "__main__":
    main()
