"""Steering test: commands headings and checks that the champion follows them."""

from mjxgait.certification import draws
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion
from mjxgait.certification.draws import COMMANDS, STEERED_FOR, Draw
from mjxgait.certification.simulate import simulate
from mjxgait.certification.tasks import demands_of
from mjxgait.champion import Champion
from mjxgait.creature import Creature


def told_to_turn(
    creature: Creature, champion: Champion, config: CertificateConfig, draw: Draw, threads: int
) -> tuple[Criterion, ...]:
    """Evaluate steering by drawn headings from perturbed starts; empty if none are commanded."""
    demands, step = demands_of(champion.task, champion.wish), creature.model.opt.timestep
    steps = round(STEERED_FOR / step)
    told = demands.commands(config, steps, step, draw.generator(COMMANDS))
    if told is None:
        return ()
    starts = draws.starts(creature, config, draw, len(told))
    fall = demands.fall(config)
    outcome = simulate(
        creature, champion, starts, STEERED_FOR, heading=told, fall=fall, threads=threads
    )
    return demands.obeyed(outcome, told, config)
