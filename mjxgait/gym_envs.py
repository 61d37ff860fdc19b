"""Gymnasium environments of the shipped creatures; importing this registers them.

    import gymnasium, mjxgait.gym_envs

    env = gymnasium.make("mjxgait/TallQuadruped-v0")

Creatures of your own: `gymnasium.make("mjxgait/Creature-v0", creature="my_dog.xml")`.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mjxgait.config.layers import find_creature, shipped_creatures
from mjxgait.config.tables import Table, read_toml
from mjxgait.errors import UserError
from mjxgait.extras import install_command
from mjxgait.lru import LruCache

try:
    import gymnasium
except ImportError:
    raise UserError(f"Gymnasium environments need an extra: {install_command('gym')}") from None

if TYPE_CHECKING:  # they lead to JAX
    from mjxgait.environments.gym import Compiled, CreatureEnv

_COMPILED: "LruCache[Compiled]" = LruCache(8)
"""Functions of the problems made last, so that environments side by side compile once."""


def env_ids() -> dict[str, str]:
    """Return the ids of the environments of shipped creatures, and the creature of each."""
    fixed = [
        name
        for name in shipped_creatures()
        if not read_toml(find_creature(name) / "creature.toml")["creature"].get("grows", False)
    ]
    return {f"mjxgait/{name.title().replace('_', '')}-v0": name for name in fixed}


def make_env(
    creature: str = "tall_quadruped",
    task: str | None = None,
    config: str | None = None,
    settings: Table | None = None,
    observe: Sequence[str] = (),
    perturbed: bool = True,
) -> "CreatureEnv":
    """Return an environment in C MuJoCo; see `mjxgait.environment` for the arguments.

    Raises:
      UserError: an invalid argument, a body that grows, or ground that is not flat.
    """
    from mjxgait.api.environments import problem_of
    from mjxgait.environments.gym import CreatureEnv, compiled

    problem = problem_of(creature, task, config, settings, observe, perturbed)
    # Of what it was made, not by what it was named: files may have been edited since.
    key = (
        problem.creature.digest,
        repr(problem.config),
        type(problem.task),
        problem.observe,
        perturbed,
    )
    return CreatureEnv(_COMPILED.find(key, lambda: compiled(problem)))


def register() -> None:
    """Register the environments."""
    entry = f"{__name__}:make_env"
    gymnasium.register("mjxgait/Creature-v0", entry)
    for name, creature in env_ids().items():
        gymnasium.register(name, entry, kwargs={"creature": creature})


register()
