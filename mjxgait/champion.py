"""`champion.json`: one gait, complete and readable without JAX: poses by joint name, cycle
settings, gains, fitness.
"""

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.settings.config import ControllerConfig
from mjxgait.settings.tables import build

SCHEMA = 1


@dataclasses.dataclass(frozen=True, eq=False)
class Champion:
    """A gait.

    key_poses: [K, J] rad. tuning: value of each tuning gene. fitness and terms: as evolution scored
    it.
    origin: where it comes from (generation, seed, versions).
    """

    creature: str
    digest: str
    key_poses: np.ndarray
    tuning: Mapping[str, float]
    controller: ControllerConfig
    fitness: float
    terms: Mapping[str, float]
    origin: Mapping[str, Any]

    @property
    def fingerprint(self) -> str:
        """Hash of all that decides how it moves: body, poses, tuning, controller; not of its
        fitness or where it comes from.
        """
        moves = {
            "creature": self.digest,
            # As float64, which is what a file gives back: a champion has one fingerprint before it
            # is written and after.
            "key_poses": np.asarray(self.key_poses, float).tolist(),
            "tuning": {name: float(value) for name, value in self.tuning.items()},
            "controller": dataclasses.asdict(self.controller),
        }
        return hashlib.sha256(json.dumps(moves, sort_keys=True).encode()).hexdigest()[:16]

    def check_finite(self, joint_names: Sequence[str]) -> None:
        """Refuses numbers that no joint can follow and that MuJoCo would complain of step by step.

        Raises:
          UserError: names the first.
        """
        for place in np.argwhere(~np.isfinite(self.key_poses)):
            k, j = map(int, place)
            raise UserError(
                f'key pose {k + 1} has {self.key_poses[k, j]} rad for joint "{joint_names[j]}": '
                "this champion cannot move; take one of another generation"
            )
        for name, value in self.tuning.items():
            if not np.isfinite(value):
                raise UserError(
                    f'the tuning "{name}" is {value}: this champion cannot move; '
                    "take one of another generation"
                )


def write_champion(champion: Champion, creature: Creature, path: Path) -> None:
    """Writes the file in one go: it is either the old one or the new one."""
    gains = zip(creature.joint_names, creature.kp, creature.kd, creature.torque_limit, strict=True)
    document = {
        "schema": SCHEMA,
        "creature": champion.creature,
        "creature_digest": champion.digest,
        "key_poses": [
            dict(zip(creature.joint_names, map(float, pose), strict=True))
            for pose in champion.key_poses
        ],
        "tuning": {name: float(value) for name, value in champion.tuning.items()},
        "controller": dataclasses.asdict(champion.controller)
        | {"mirrored": creature.symmetric and champion.controller.mirror},
        "gains": {
            name: {"kp": float(kp), "kd": float(kd), "torque_limit": float(limit)}
            for name, kp, kd, limit in gains
        },
        "fitness": champion.fitness,
        "terms": dict(champion.terms),
        "origin": dict(champion.origin),
    }
    scratch = path.with_suffix(".tmp")
    scratch.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    scratch.replace(path)


def read_champion(path: Path, creature: Creature) -> Champion:
    """The gait in a file, for the creature it was evolved on.

    Raises:
      UserError: the file is missing, not a champion, or of another creature.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["schema"] != SCHEMA:
            raise UserError(
                f"{path}: written with schema {document['schema']}, this version reads {SCHEMA}"
            )
        if document["creature_digest"] != creature.digest:
            raise UserError(
                f"{path}: evolved on another body than {creature.name} as it is now; use the run's "
                "own creature folder"
            )
        settings = {
            key: value for key, value in document["controller"].items() if key != "mirrored"
        }
        champion = Champion(
            creature=document["creature"],
            digest=document["creature_digest"],
            key_poses=np.array(
                [[pose[name] for name in creature.joint_names] for pose in document["key_poses"]]
            ),
            tuning=document["tuning"],
            controller=build(ControllerConfig, settings, str(path)),
            fitness=document["fitness"],
            terms=document["terms"],
            origin=document["origin"],
        )
    except FileNotFoundError:
        raise UserError(f"{path}: no such file; the run has no champion yet") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UserError(f"{path}: not a champion file ({error!r})") from None
    try:
        champion.check_finite(creature.joint_names)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None
    return champion
