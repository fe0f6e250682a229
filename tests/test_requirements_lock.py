import re
import tomllib
from pathlib import Path

HOME = Path(__file__).parent.parent


def test_the_lock_has_every_package_that_is_needed():
    project = tomllib.loads((HOME / "pyproject.toml").read_text())["project"]
    wanted = {re.split(r"[^A-Za-z0-9._-]", line)[0].lower() for line in project["dependencies"]}
    locked = set(re.findall(r"^([A-Za-z0-9._-]+)==", (HOME / "requirements.lock").read_text(), re.MULTILINE))
    assert "numpy" in wanted
    assert wanted <= {name.lower() for name in locked}
