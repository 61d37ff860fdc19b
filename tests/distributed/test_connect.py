"""Addresses that `--cluster` accepts; without it Ray is not used."""

import socket
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import STOOL

from mjxgait.distributed.connect import connected
from mjxgait.errors import UserError
from mjxgait.extras import install_command


def refusal(address: str) -> str:
    with pytest.raises(UserError) as said, connected(address, print):
        pass
    return str(said.value)


@pytest.mark.parametrize("address", ["", "10.0.0.5", ":6379", "head:", "head:port"])
def test_an_address_is_a_host_and_a_port(address: str):
    assert "give auto or HOST:PORT, such as 10.0.0.5:6379" in refusal(address)


def test_a_missing_answer_is_reported_soon():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    assert f"no answer from {address}" in refusal(address)


def test_auto_means_the_cluster_of_this_machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setenv("RAY_TMPDIR", str(tmp_path))
    assert "no part of a cluster; start one with `ray start --head" in refusal("auto")


def test_without_ray_the_error_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with socket.socket() as head:
        head.bind(("127.0.0.1", 0))
        head.listen()
        said = refusal(f"127.0.0.1:{head.getsockname()[1]}")
    assert f"--cluster needs Ray: {install_command('cluster')}, on every machine" in said


WITHOUT = """
import sys
sys.modules["ray"] = None  # whoever imports it fails
from mjxgait.cli import main
main(sys.argv[1:])
"""


@pytest.mark.thorough("the check has no ray; this trains in a process that must not find it")
def test_training_without_a_cluster_needs_no_ray(tmp_path: Path):
    """A whole run, on islands too."""
    small = "--population 6 --generations 1 --rollout.seconds 0.4 --rollout.starts 2"
    small += " --rollout.lanes 4 --examination.candidates 0 --no-plots --evolution.islands.count 2"
    command = [sys.executable, "-c", WITHOUT, "train", "--env", str(STOOL), *small.split()]
    done = subprocess.run(
        [*command, "--out", str(tmp_path / "run")], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "2 islands" in done.stdout
