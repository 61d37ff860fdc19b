"""What each measure of a certificate says in plain words where it fails, and what to try.

One table for all tasks. Options in a remedy are those of `mjxgait train`; without the dashes they
are keys of a file for `--config`.
"""

import dataclasses
import fnmatch
from collections.abc import Mapping

from mjxgait.certification.criteria import Criterion, Measure

AGAIN = (
    "Train longer (--generations), or with other seeds: --tries 3 stops at the first that passes."
)
CALMER = "Ask for a slower walk: --speed, or a lower --fitness.speed."
FALLS, AHEAD, USUAL, FOLLOWS = range(4)
"""Order of causes: a fall spoils all else, then a body that makes no headway. What only repeats
other measures comes last."""


@dataclasses.dataclass(frozen=True)
class Entry:
    """A measure in words.

    measure: pattern of its name. words: sentence on the cause. It may show `{v}`, the value, `{t}`,
    the threshold, `{rest}` and `{spare}`, what they lack of 1, `{name}` and `{after}`, see `cause`.
    remedy: sentence. by_task: remedies of single tasks, where they have settings of their own.
    criterion: name of the criterion, if others have such a measure too. order: of causes.
    """

    measure: str
    words: str
    remedy: str = AGAIN
    by_task: Mapping[str, str] = dataclasses.field(default_factory=dict)
    criterion: str = "*"
    order: int = USUAL

    def fits(self, criterion: Criterion, measure: Measure) -> bool:
        """Return whether the entry is about this measure."""
        named = fnmatch.fnmatchcase(criterion.name, self.criterion)
        return named and fnmatch.fnmatchcase(measure.name, self.measure)

    def cause(self, measure: Measure, after: float | None) -> str:
        """Return the sentence. after: s, mean time of the falls; None if unknown."""
        when = "" if after is None else f" after {after:.1f} s on average"
        v, t = measure.value, measure.threshold
        shown = {"v": v, "t": t, "rest": 1 - v, "spare": 1 - t, "name": measure.name}
        return self.words.format(**shown, after=when)

    def remedy_for(self, task: str) -> str:
        """Return the remedy in runs of a task."""
        return self.by_task.get(task, self.remedy)


def _raise(weight: str) -> str:
    return f"Raise --fitness.weights.{weight}."


def _walk(remedy: str) -> dict[str, str]:
    return {"walk": remedy}


def _goals(remedy: str) -> dict[str, str]:
    return dict.fromkeys(("hop", "limbo", "travel"), remedy)


ON_TWO_LEGS = (
    "Train longer (--generations), or with another --seed; on two legs try --fitness.hardening 8 "
    "--fitness.contact 0."
)
STAYS_UP = (
    Entry(
        "least upright",
        "It falls over without any disturbance.",
        by_task=_walk(ON_TWO_LEGS),
        order=FALLS,
    ),
    Entry(
        "least height",
        "Its trunk sinks to {v:.0%} of its standing height, undisturbed; {t:.0%} is allowed.",
        by_task=_walk(
            "Train longer (--generations), or ask for a high trunk: --fitness.wish.height 1."
        ),
        order=FALLS,
    ),
    Entry(
        "greatest height",
        "Its trunk rises to {v:.0%} of its standing height; {t:.0%} is allowed.",
        by_task=_walk("Ask for the standing height: --fitness.wish.height 1."),
    ),
    Entry(
        "time on wrong parts",
        "A part that is not a foot is on the floor for {v:.0%} of the time.",
        by_task=_goals(_raise("ground"))
        | _walk(
            "Raise --fitness.weights.touch; or name the part under `ground` in creature.toml, if "
            "it may touch the floor."
        ),
    ),
    Entry(
        "tilt beyond standing (deg)",
        "Its trunk leans {v:.0f} degrees farther than standing; {t:.0f} are allowed.",
        _raise("tilt"),
    ),
)
PROGRESS = (
    Entry(
        "strides",
        "It makes hardly a stride that leads anywhere; {t:.0f} are needed.",
        "Train longer (--generations), or with another --seed, or widen `range` of the legs in "
        "creature.toml.",
        order=AHEAD,
    ),
    Entry("shortest stride / mean stride", "Not every stride leads forward."),
    Entry(
        "speed (body lengths/s)",
        "It goes at {v:.2f} body lengths/s; {t:.2g} are needed.",
        "Train longer (--generations), or raise --fitness.speed, up to which faster is better.",
    ),
    Entry(
        "drift / distance",
        "It drifts to the side by {v:.0%} of its way; {t:.0%} is allowed.",
        _raise("drift"),
    ),
    Entry(
        "off straight ahead (deg)",
        "Its nose points up to {v:.0f} degrees off its way; {t:.0f} are allowed.",
        _raise("drift"),
    ),
    Entry(
        "second half*/ first*",
        "It slows down: the second half of the time brings {v:.0%} of the first; {t:.0%} is "
        "needed.",
        "Simulate longer episodes: --rollout.seconds.",
        _walk("Raise --fitness.weights.fade, or simulate longer episodes: --rollout.seconds."),
    ),
    Entry(
        "autocorrelation at stride period",
        "Its strides do not repeat: they are alike by {v:.2f}, and {t:.2g} is needed.",
    ),
    Entry(
        "variation of stride period",
        "Its strides are uneven: their period varies by {v:.0%}, and {t:.0%} is allowed.",
    ),
)
MORE_STARTS = (
    "Simulate more starts in each generation (--rollout.starts), or train longer (--generations)."
)
DISTURBED = (
    Entry(
        "share that stays up",
        "It falls on {rest:.0%} of the perturbed starts{after}; {spare:.0%} may fall.",
        MORE_STARTS,
        criterion="perturbed starts",
    ),
    Entry(
        "share that stays up",
        "It falls after {rest:.0%} of the pushes; {spare:.0%} may fall.",
        "Push harder in training (--rollout.push), or train longer (--generations).",
        criterion="pushes",
    ),
    Entry(
        "share that obeys",
        "It does not follow {rest:.0%} of the commanded turns; {spare:.0%} may be missed.",
        "Ask for slower turns (--steer), or train longer (--generations).",
    ),
    Entry(
        "share that follows",
        "It does not follow {rest:.0%} of the lights that move; {spare:.0%} may be missed.",
        criterion="a light that moves",
    ),
    Entry(
        "share that *",
        "It does not succeed from {rest:.0%} of the perturbed starts; {spare:.0%} may fail.",
        MORE_STARTS,
    ),
)
AT_A_FINER_STEP = (
    Entry(
        "failures in *",
        "At half the time step it fails {v:.0f} measures: the motion depends on the size of the "
        "step.",
        order=FOLLOWS,
    ),
    Entry(
        "change*",
        "At half the time step the result differs by {v:.0%}; {t:.0%} is allowed.",
        criterion="half the time step",
        order=FOLLOWS,
    ),
    Entry(
        "change",
        "The result differs by {v:.0%} from that of evolution; {t:.0%} is allowed.",
        criterion="as in evolution",
        order=FOLLOWS,
    ),
)
GAIT = (
    Entry(
        "stride frequency / animal's",
        "It strides {v:.1f} times as often as an animal of its mass that begins to gallop; "
        "{t:.1f} times is allowed.",
        "Raise --fitness.weights.frequency, or ask for a slower walk: --speed.",
    ),
    Entry(
        "stride length / hip height",
        "Its strides are {v:.2f} hip heights long; {t:.2g} is needed.",
        "Ask for an animal's strides (--fitness.wish.stride 1), or widen `range` of the legs in "
        "creature.toml.",
    ),
    Entry(
        "least clearance / hip height",
        "A foot rises by only {v:.1%} of the hip height in a stride; {t:.0%} is needed.",
        "Raise --fitness.clearance or --fitness.weights.clearance.",
    ),
    Entry(
        "worst foot's slip / distance",
        "A foot slides {v:.0%} of the way; {t:.0%} is allowed.",
        _raise("slip"),
    ),
    Entry(
        "least duty factor",
        "A foot is on the floor for only {v:.0%} of the time; {t:.0%} is needed.",
        _raise("duty"),
    ),
    Entry(
        "greatest duty factor",
        "A foot is on the floor for {v:.0%} of the time; {t:.0%} is allowed.",
        _raise("duty"),
    ),
    Entry(
        "flicker of a foot per stride",
        "Its feet lose the floor for a moment {v:.1f} times in a stride; {t:.0f} times is allowed.",
        "Make contact flicker dearer: a higher --fitness.weights.patter, such as 3.",
    ),
    Entry(
        "buzz of a joint / joint speed",
        "A joint vibrates, with {v:.0%} of the joints' speed; {t:.0%} is allowed.",
        by_task=_walk(
            "Raise --fitness.weights.energy, or soften the joints: --drive.stiffness 0.7."
        )
        | dict.fromkeys(("roam", "follow-on-land"), _raise("vibration")),
    ),
    Entry("left and right *", "It limps: its {name} are {v:.0%} apart; {t:.0%} is allowed."),
)
PHYSICS = (
    Entry(
        "joint speed (rad/s)",
        "A joint turns at {v:.0f} rad/s; {t:.0f} is allowed.",
        by_task=_goals(_raise("fast")) | _walk(CALMER),
    ),
    Entry(
        "joint past its range (rad)",
        "A joint goes {v:.2f} rad past its range; {t:.2g} is allowed.",
        "Narrow `range` of that joint in creature.toml.",
        _walk("Raise --fitness.weights.limits, or narrow `range` of the joint in creature.toml."),
    ),
    Entry(
        "body speed / sqrt(g h)",
        "Its fastest part moves at {v:.1f} sqrt(g h); {t:.2g} is allowed.",
        by_task=_walk(
            "Raise --fitness.weights.foot_speed, or ask for a slower walk: --speed, or a lower "
            "--fitness.speed."
        ),
    ),
    Entry("body speed (m/s)", "Its fastest part moves at {v:.1f} m/s; {t:.2g} is allowed."),
    Entry(
        "penetration / hip height",
        "A foot is stamped {v:.0%} of the hip height deep into the floor; {t:.0%} is allowed.",
        by_task=_walk("Raise --fitness.weights.foot_height: lower steps land softer."),
    ),
    Entry(
        "torque / limit",
        "A joint has {v:.2f} times its torque limit.",
        "Raise `torque_limit` in creature.toml.",
    ),
    Entry(
        "overlap / hip height",
        "Parts stand {v:.0%} of the hip height deep in each other; {t:.0%} is allowed.",
        by_task=_goals(_raise("overlap")) | _walk(_raise("overlap")),
    ),
    Entry(
        "not examined: mass without a shape / mass",
        "Parts with {v:.0%} of the mass have no shape, so that their overlap is unknown; {t:.0%} "
        "is allowed.",
        "Put their mesh files beside the model, or name their folder with `mjxgait import "
        "--search`.",
    ),
)
TARGETS = (
    Entry(
        "off the speed of *",
        "It misses the target speed by {v:.0%}; {t:.0%} is allowed.",
        "Ask for another --speed, or raise --fitness.wish.weights.speed.",
    ),
    Entry(
        "footfalls of a *",
        "Its feet fall in another order than that of the target gait.",
        "Raise --fitness.wish.weights.gait, or ask for another --gait; natural is an animal's.",
    ),
    Entry(
        "off the commanded heading (deg)",
        "It is {v:.0f} degrees off the commanded heading; {t:.0f} are allowed.",
        "Ask for slower turns: --turn or --steer.",
    ),
    *(
        Entry(
            f"off the {name} of *",
            "It is {name} by {v:.2g}; {t:.2g} is allowed.",
            f"Raise --fitness.wish.weights.{name}, or ask for another --fitness.wish.{name}.",
        )
        for name in ("height", "bounce", "sway", "stride", "duty_factor", "reach", "pitch")
    ),
)
OTHER_TASKS = (
    Entry("speed (m/s)", "It moves at {v:.2f} m/s; {t:.2g} is needed."),
    Entry("speed towards it (m/s)", "It nears the light at {v:.2f} m/s; {t:.2g} is needed."),
    Entry("share of the cube", "It has {v:.0%} of the cube; {t:.0%} is needed, half is a draw."),
    Entry("height of the lowest part (m)", "It jumps {v:.2f} m high; {t:.2g} is needed."),
    Entry(
        "way / path", "It does not go straight: its way is {v:.0%} of its path; {t:.0%} is needed."
    ),
    Entry(
        "farthest left / goal distance",
        "In the end it is up to {v:.0%} of the way from its goal; {t:.0%} is allowed.",
        "Train longer (--generations), or simulate longer episodes: --rollout.seconds.",
    ),
    Entry(
        "least clearance (m)",
        "It touches the bar.",
        by_task={
            "limbo": "Raise --fitness.weights.bar, or begin with a higher bar: --fitness.higher."
        },
    ),
    Entry("turn (deg/s)", "It turns at {v:.0f} degrees/s; {t:.0f} is needed."),
    Entry(
        "from the start / hip height",
        "It moves {v:.1f} hip heights away from its place; {t:.2g} is allowed.",
    ),
    Entry(
        "far end in the next block / size",
        "A block folds {v:.0%} of its size deep through the next one; {t:.0%} is allowed.",
        "Make overlap dearer: a lower --fitness.overlap.",
    ),
    Entry(
        "* block's size",
        "Blocks stand {v:.0%} of their size deep in each other or in the ground; {t:.0%} is "
        "allowed.",
        "Make overlap dearer: a lower --fitness.overlap.",
    ),
    Entry(
        "momentum from elsewhere / exchanged",
        "{v:.0%} of its momentum does not come from the water; {t:.0%} is allowed.",
        by_task={"swim": "Make that dearer: a lower --fitness.elsewhere."},
    ),
)
TABLE = (
    *STAYS_UP,
    *PROGRESS,
    *DISTURBED,
    *AT_A_FINER_STEP,
    *GAIT,
    *PHYSICS,
    *TARGETS,
    *OTHER_TASKS,
)
"""All entries; the first that fits a measure counts."""
