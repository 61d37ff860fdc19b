"""Bodies that grew, with the brains of a first population, and how the examiner simulates them."""

import contextlib
import dataclasses
import functools

import numpy as np
from end_to_end.unevolved import embodied

from mjxgait.certification import CertificateConfig
from mjxgait.certification.acceptance import task_rules
from mjxgait.certification.trials import simulate
from mjxgait.config.layers import data_folder
from mjxgait.controllers.sims_brain.reference import KEPT, brain_reference
from mjxgait.creature import load_creature
from mjxgait.errors import UserError
from mjxgait.plugins.registry import build_config
from mjxgait.reference.starts import nominal_starts
from mjxgait.training.experiment import build_experiment

LIGHTS = (10.0, 0.0, 0.0), (0.0, 10.0, 0.0)


def remembers(body, champion):
    """Whether a neuron with a memory drives a hinge."""
    brain = brain_reference(body, champion, body.model.opt.timestep)
    first = min(brain.place.values())
    kept = {int(n) + first for kind in KEPT if kind in brain.alike for n in brain.alike[kind]}
    return bool(kept & set(brain.driver.tolist()))


def grown(task, **settings):
    """All of a first population that have a hinge: bodies and champions."""
    room = {"nodes": 3, "parts": 4, "links": 4, "local": 3, "central": 2}
    table = {"use": {"controller": "brain", "task": task}, "controller": room | settings}
    experiment = build_experiment(
        load_creature(data_folder("envs") / "blocks"), build_config(table, task)
    )
    state = embodied(experiment)
    known = {name: np.zeros(getattr(state, name).shape) for name in ("fitness", "terms", "outcome")}
    state = dataclasses.replace(state, **known)
    for rank in range(len(state.fitness)):
        champion = experiment.champion(state, {}, rank)
        with contextlib.suppress(UserError):
            yield champion.embodied(experiment.creature), champion


@functools.cache
def with_a_brain(task):
    """The first of a first population moved by the light and a neuron with memory, and its body."""
    for body, champion in grown(task):
        if remembers(body, champion):
            ends = [examined(body, champion, 1.0, None, None, light)[0][-1] for light in LIGHTS]
            if np.abs(ends[0] - ends[1]).max() > 0.01:
                return body, champion
    raise AssertionError("none turns to the light")


CONTACT_CODE = 4
"""Source of a part's contact; see `Nerves`."""


@functools.cache
def that_feels_its_blocks():
    """The first in water that a touch of two of its blocks moves otherwise, and its body.

    The hinges of its root's children pull at full strength, all others as its blocks touch.
    """
    for body, plain in grown("follow", collide=True, touch=True):
        source = np.full_like(plain.genome["nerves.effect_source"], CONTACT_CODE)
        source[1] = 0
        weight = np.ones_like(plain.genome["nerves.effect_weight"])
        new = {"nerves.effect_source": source, "nerves.effect_weight": weight}
        champion = dataclasses.replace(plain, genome=plain.genome | new)
        numb = dataclasses.replace(
            champion, settings=dataclasses.replace(champion.settings, touch=False)
        )
        ends = [examined(body, one, 3.0, None, None)[0][-1] for one in (champion, numb)]
        if np.abs(ends[0] - ends[1]).max() > 0.01:
            return body, champion
    raise AssertionError("none feels its blocks")


def examined(creature, champion, seconds, disturbed, push, light=None):
    """The same by the examiner: poses [T, nq], targets or for brains torques [T, J], and s until
    the fall or infinity.
    """
    task = task_rules(champion.task, champion.wish)
    plain = task.aimed(nominal_starts(creature, 1), CertificateConfig())
    if light is not None:
        plain = dataclasses.replace(plain, light=np.array([light]))
    starts = plain
    if disturbed:
        starts = dataclasses.replace(
            starts,
            mass=plain.mass * disturbed["mass"],
            friction=plain.friction * disturbed["friction"],
            slope=np.array([disturbed["slope"]]),
        )
    if push:
        moment = (push["step"] + 0.5) * creature.model.opt.timestep
        starts = dataclasses.replace(
            starts, push_time=np.array([moment]), push=np.array([push["speed"]])
        )
    outcome = simulate(creature, champion, starts, seconds, record=1, threads=1)
    film = outcome.trajectory
    commands = film.torque if champion.controller == "brain" else film.target
    return film.qpos[0], commands[0], outcome.fell[0]
