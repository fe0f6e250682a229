"""Play a motion, switch when a condition holds, end cleanly.

python examples/play_ten_lines.py
"""

import motiondeck

with motiondeck.play("thesis15", "walk", physics=False) as deck:
    print("playing", deck.status().motion, "out of", ", ".join(deck.motions))
    if not deck.status().paused:
        seconds = deck.switch("jog").wait()
        print(f"jogging, {seconds:.2f} s after the command")
print("ended:", deck.wait()["reason"])
