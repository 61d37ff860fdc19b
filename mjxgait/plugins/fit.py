"""Check that a controller and a task fit the creature."""

from typing import Any

from mjxgait.config.schema import Config
from mjxgait.controllers.expressions.written import check_programs
from mjxgait.creature import Creature
from mjxgait.creature.ground.spec import FLAT
from mjxgait.errors import UserError
from mjxgait.kinds import controller_kind, known_task, skills_of, tasks


def check_fit(creature: Creature, config: Config) -> None:
    """Refuse a controller, a task or settings that this body cannot use.

    Raises:
      UserError: gives the reason and a remedy.
    """
    _check_options(creature, config)
    if config.use.task == "compete":
        _check_contest(creature.name, config)
    if config.use.controller == "program":
        check_programs(creature, config)
    if creature.settings.creature.grows:
        _check_growing(creature, config)
    else:
        _check_given(creature, config)


def _check_options(creature: Creature, config: Config) -> None:
    """Refuse settings that contradict each other, whatever the body."""
    name, task = creature.name, config.use.task
    if config.examination.level != "walks" and task != "walk":
        raise UserError(
            f"examination.level = {config.examination.level}: it is for walks, and this task is "
            f"{task}; leave it out"
        )
    kind = known_task(task)
    if config.rollout.moves and kind and "follow" not in kind.tables:
        raise UserError(
            f"{name}: rollout.moves moves the lights of followers, and the task {task} has none; "
            "leave it out"
        )
    if config.evolution.family < 1 and config.evolution.islands.count > 1:
        raise UserError(
            f"{name}: evolution.family is for one population, and islands are several as they are; "
            "take --evolution.family 1"
        )
    if getattr(config.controller, "in_phase", False) and config.controller.mirror:
        raise UserError(
            f"{name}: controller.in_phase makes each pose its own mirror image, so with "
            "controller.mirror each would come twice; take --controller.no-mirror, or --gait bound"
        )
    if around := getattr(config.controller, "around", ()):
        wanted = config.controller.key_poses * len(creature.joints.names)
        if len(around) != wanted:
            raise UserError(
                f"controller.around has {len(around)} angles; {config.controller.key_poses} key "
                f"poses of {name} have {wanted}; --gait auto begins with no poses that were drawn"
            )


def _check_contest(name: str, config: Config) -> None:
    """Refuse settings under which results against different opponents are compared."""
    if config.evolution.survival != "children":
        raise UserError(
            f"{name}: opponents change, and with evolution.survival = "
            f'"{config.evolution.survival}" parents keep what they had against earlier ones; take '
            "--evolution.survival children"
        )
    if not config.evolution.elites:
        raise UserError(
            f"{name}: opponents change, and with evolution.elite = "
            f"{config.evolution.elite:g} the best parent is not evaluated again; take "
            "--evolution.elite 0.25"
        )
    evolution = config.evolution
    for key, on, remedy in (
        ("forced.enabled", evolution.forced.enabled, "forced.no-enabled"),
        ("remember", evolution.remember, "no-remember"),
        ("restart.every", evolution.restart.every, "restart.every 0"),
    ):
        if on:
            raise UserError(
                f"{name}: evolution.{key} compares results against different opponents; take "
                f"--evolution.{remedy}"
            )
    if config.evolution.islands.count > 1:
        raise UserError(
            f"{name}: each island has its own opponents, so those that migrate would meet another; "
            "take --evolution.islands.count 1, or --runs for several runs side by side"
        )


def _check_given(creature: Creature, config: Config) -> None:
    """Refuse settings of bodies that grow, for a body that a file gives."""
    controller, task, name = config.use.controller, config.use.task, creature.name
    if creature.settings.creature.beside:
        raise UserError(
            f"{name}: creature.beside names bodies that a run does not simulate; take them out of "
            "creature.xml and creature.toml, or evolve such a contest with --env blocks"
        )
    if config.rollout.step:
        raise UserError(
            f"{name}: rollout.step is for bodies that grow; creature.xml has this one's step"
        )
    if controller_kind(controller).grows:
        raise UserError(
            f"{name}: its body is there already, and a {controller} grows with its own; take "
            "--env blocks, or another controller"
        )
    kind = known_task(task)
    if kind and kind.modular:
        raise UserError(f"{name}: only bodies that grow {task}; take --env blocks, or another task")


def _check_growing(creature: Creature, config: Config) -> None:
    """Refuse settings of bodies that a file gives, for a body that grows."""
    controller, task, name = config.use.controller, config.use.task, creature.name
    if not controller_kind(controller).grows:
        raise UserError(
            f"{name}: its body grows with its brain, so {controller} has nothing to move; leave "
            "--controller out"
        )
    if task in tasks() and not tasks()[task].modular:
        known = ", ".join(name for name, one in tasks().items() if one.modular)
        raise UserError(f"{name}: bodies that grow cannot {task}, only {known}")
    step = float(creature.model.opt.timestep)
    if config.rollout.step not in (0.0, step):
        raise UserError(
            f"{name}: rollout.step = {config.rollout.step:g}, but its creature.xml has {step:g} s; "
            "runs that are compared or resumed have one step"
        )
    _check_settings(name, config)
    _check_skills(name, config)


def _check_skills(name: str, config: Config) -> None:
    """Refuse trials and effectors that do not suit the number of skills."""
    skills = skills_of(config.use.task)
    if not skills:
        return
    count, task = len(skills), config.use.task
    least = 2 * count if "follow" in skills else count
    if config.rollout.starts < least or config.rollout.starts % count:
        raise UserError(
            f"{name}: rollout.starts = {config.rollout.starts}, and the {count} skills of {task} "
            f"share the trials equally; take a multiple of {count} from {least} on"
        )
    if config.rollout.promote < 1:
        raise UserError(
            f"{name}: rollout.promote = {config.rollout.promote:g} would choose by the first skill "
            f"alone; take --rollout.promote 1 for {task}"
        )
    own: Any = config.controller
    if own.skill:
        raise UserError(
            f"{name}: controller.skill = {own.skill}, and {task} commands its skills; leave it out"
        )
    if own.skills != count:
        raise UserError(
            f"{name}: controller.skills = {own.skills}, and {task} has {count} skills; take "
            f"--controller.skills {count}"
        )
    if config.examination.tryout:
        raise UserError(f"{name}: {task} has no pre-screening; take --examination.tryout 0")


def _check_settings(name: str, config: Config) -> None:
    """Refuse settings that need an existing body, and episodes that end before scoring begins."""
    rollout = config.rollout
    skills = {
        f"fitness.{skill}": getattr(config.fitness, skill) for skill in skills_of(config.use.task)
    }
    for table, own in (skills or {"fitness": config.fitness}).items():
        settle = getattr(own, "settle", 0.0)
        if settle >= rollout.seconds:
            raise UserError(
                f"{name}: {table}.settle = {settle:g} s do not count, and an episode lasts "
                f"{rollout.seconds:g} s; make rollout.seconds longer or {table}.settle shorter"
            )
    needs = {
        "evolution.body": config.evolution.body != 1.0,
        "evolution.pose_span": config.evolution.pose_span != 0.0,
        "rollout.ground": rollout.ground != FLAT,
        "rollout.slope or rollout.rough": rollout.uneven,
        "rollout.masses": rollout.masses != 0.0,
        "rollout.body": rollout.body != "constants",
        "rollout.physics": rollout.physics != "auto",
    }
    for key, given in needs.items():
        if given:
            raise UserError(f"{name}: {key} is for a body that is there; this one grows")
