import numpy as np
import pytest

import motiondeck
from controller.deck.joins.deck_motions import PEAKS_OVER, read_motions
from controller.motion.clip import walked_clip
from shipped_libraries import shipped


@pytest.mark.thorough
@pytest.mark.parametrize("motion", ["walk", "jog", "waltz"])
def test_the_peaks_of_a_motion_are_those_of_its_joints_in_the_world(motion):
    """Seen as a clip on the deck's body is laid out, apart from the deck: a joint of a walk goes along with it."""
    seen = read_motions(shipped())[motion]
    library = motiondeck.load_library("thesis15")
    channels = library.generate(motion, seconds=2.0 * seen.seconds, rate=1.0 / PEAKS_OVER)
    posture = library.model.encoding.decode(channels)
    joints = walked_clip(motion, library.skeleton, posture, 1.0 / PEAKS_OVER).joints()
    step = np.linalg.norm(np.diff(joints, axis=0), axis=-1) / PEAKS_OVER
    assert seen.speed == pytest.approx(step.max(), rel=0.05)
    bent = np.linalg.norm(np.diff(joints, 2, axis=0), axis=-1) / PEAKS_OVER**2
    assert seen.acceleration == pytest.approx(bent.max(), rel=0.1)
