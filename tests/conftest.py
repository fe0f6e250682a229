"""What all tests share: where real recordings are, and property tests that try the same examples every time."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile(
    "motiondeck",
    derandomize=True,
    deadline=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("motiondeck")


@pytest.fixture(scope="session")
def mocap_data() -> Path:
    """The folder of real recordings: MOTIONDECK_DATA, or shared/data beside the repository."""
    given = os.environ.get("MOTIONDECK_DATA")
    folder = Path(given) if given else Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"there is no folder {folder}: set MOTIONDECK_DATA to one with recordings")
    return folder
