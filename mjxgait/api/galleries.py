"""Several champions on one page, in one picture and in one video."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mjxgait.api.exports import PAGES, folder_of, sized
from mjxgait.api.run import Place, Run, runs_of
from mjxgait.api.studies import STUDY, champions_of_study
from mjxgait.errors import UserError
from mjxgait.files import path_of, require_ending
from mjxgait.kinds import title_of
from mjxgait.output import Tell, silent
from mjxgait.training.folder import CHAMPION, CONFIG, require_output

if TYPE_CHECKING:
    from mjxgait.champion import Champion
    from mjxgait.creature import Creature
    from mjxgait.rendering.gallery import Entry

MAX_CHAMPIONS = 60
"""Largest number of champions on a page."""
STILLS = (".webp", ".png", ".jpg")
UNEXAMINED = "Not certified: a study keeps no certificates"
SECONDS, FPS = 5.0, 20
"""Length and frames per second of a video."""


def gallery(
    runs: Run | Place | Sequence[Run | Place],
    out: Place,
    *,
    poster: Place | None = None,
    video: Place | None = None,
    title: str = "",
    tell: Tell = silent,
) -> Path:
    """Write an offline page on which champions move side by side, by what they do; return it.

    Does the same as `mjxgait gallery`. Each has a word for how it moves (docs/guide/seeing.md).

    Args:
      runs: runs, and folders of runs, of which those with a champion count.
      out: the page, ending with .html.
      poster: a picture of all: .webp, .png or .jpg.
      video: of all: .webp, .gif or .mp4 (extra [video]).
      title: over all; by default what the runs evolved.
      tell: called with what was written, and with the strategies.

    Raises:
      UserError: no champion, too many, a wrong ending, or a file cannot be written.
    """
    page, still = path_of(out), None if poster is None else path_of(poster)
    film = None if video is None else path_of(video)
    check_files(page, still, film)
    shown = entries_of(map(folder_of, runs_of(runs)), tell)
    from mjxgait.rendering.gallery import tally
    from mjxgait.web.gallery import build_gallery
    from mjxgait.web.page import save_page

    title = title or _title(shown)
    save_page(page, build_gallery(shown, title))
    tell(sized(page))
    if still or film:
        _pictures(shown, title, still, film, tell)
    certified = sum(one.certified for one in shown)
    tell(f"{certified} of {len(shown)} certified: {tally(shown)}")
    return page


def check_files(page: Path | None, poster: Path | None, video: Path | None) -> None:
    """Check before long work that all can be written.

    Raises:
      UserError: names the file.
    """
    if page is not None:
        require_ending(page, PAGES)
        require_output(page)
    if poster is not None:
        require_ending(poster, STILLS)
        require_output(poster)
    if video is not None:
        from mjxgait.rendering.video import require_writer

        require_writer(video)


def entries_of(folders: Iterable[Path], tell: Tell) -> "list[Entry]":
    """Return the champions of runs, of runs inside folders, and of studies, each once, sorted.

    Raises:
      UserError: a folder is none of these, or there is no champion, or too many.
    """
    from mjxgait.rendering.gallery import Entry, by_strategy
    from mjxgait.rendering.video import LOOP_SECONDS, champion_of
    from mjxgait.rendering.walk import doubt, record_walk

    runs, studied = _found(folders, tell)
    count = len(runs) + len(studied)
    if not count:
        raise UserError("gallery: no run has a champion yet; name runs that have ended")
    if count > MAX_CHAMPIONS:
        raise UserError(
            f"gallery: {count} champions; a page shows at most {MAX_CHAMPIONS}; name fewer runs or "
            "studies"
        )
    shown = []
    for name, run in zip(_names(runs), runs, strict=True):
        walk = champion_of(run, LOOP_SECONDS).walk
        shown.append(Entry(name, walk, doubt(run, walk)))
    for name, creature, champion in studied:
        walk = record_walk(champion.embodied(creature), champion, LOOP_SECONDS)
        shown.append(Entry(name, walk, UNEXAMINED))
    return by_strategy(shown)


def _found(
    folders: Iterable[Path], tell: Tell
) -> "tuple[list[Path], list[tuple[str, Creature, Champion]]]":
    """Runs with a champion; and name, creature and champion of those that a study keeps."""
    from mjxgait.inspect import runs_in

    runs: dict[Path, Path] = {}
    studied = []
    for folder in folders:
        if (folder / STUDY).is_file():
            studied += champions_of_study(folder)
            continue
        inner = [folder] if (folder / CONFIG).is_file() else runs_in(folder)
        if not inner:
            raise UserError(f"{folder}: neither a run folder nor a folder of runs")
        for run in inner:
            if (run / CHAMPION).is_file():
                runs[run.resolve()] = run
            else:
                tell(f"{run}: has no champion yet, and is left out")
    return list(runs.values()), studied


def _names(runs: Sequence[Path]) -> list[str]:
    """Names of the folders, with the folder around each where two are alike."""
    names = [run.resolve().name for run in runs]
    if len(set(names)) == len(names):
        return names
    return [f"{run.resolve().parent.name}/{run.resolve().name}" for run in runs]


def _title(shown: "Sequence[Entry]") -> str:
    tasks = dict.fromkeys(title_of(one.walk.champion.task) for one in shown)
    creatures = dict.fromkeys(one.walk.creature.title for one in shown)
    return f"{', '.join(creatures)}: {', '.join(tasks)}"


def _pictures(
    shown: "Sequence[Entry]", title: str, poster: Path | None, video: Path | None, tell: Tell
) -> None:
    """Write a picture and a video of all."""
    from mjxgait.files import replaced, writing
    from mjxgait.rendering.gallery import MOMENT, Sheet
    from mjxgait.rendering.video import write_video

    sheet = Sheet(shown, title, SECONDS)
    if poster is not None:
        with writing(poster), replaced(poster) as beside:
            sheet.picture(MOMENT).save(beside)
        tell(sized(poster))
    if video is not None:
        write_video(sheet.pictures(SECONDS, FPS), video, FPS)
        tell(sized(video))
