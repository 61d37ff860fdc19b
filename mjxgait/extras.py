"""Optional packages: the command that installs them. `mjxgait doctor` needs it without MuJoCo."""

from importlib import resources
from pathlib import Path


def install_command(extra: str) -> str:
    """Return the command that installs an extra, of the package or of the checkout in use."""
    checkout = Path(str(resources.files("mjxgait"))).parent
    if not (checkout / "pyproject.toml").is_file():
        return f'pip install "mjxgait[{extra}]"'
    # Editable: a plain install would replace the checkout by a copy of the package.
    place = "." if checkout.resolve() == Path.cwd().resolve() else checkout
    return f'pip install -e "{place}[{extra}]"'
