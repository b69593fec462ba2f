"""``implicit-decals lessons``: lessons of the contact lab as pages for any browser."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from decals.apps.commands.progress_bars import progress_bars
from decals.apps.output import print_path
from decals.errors import InvalidInput
from decals.output_folder import output_folder


def lessons(
    folder: Path | None = None,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    language: Annotated[tuple[str, ...], Parameter(negative=())] = ("en",),
) -> None:
    """Write lessons of the contact lab as HTML pages, one for each lesson and language.

    A page opens from its file or from a link, without a server and without a network.

    Parameters
    ----------
    folder
        Folder of lessons. Default: those that are installed.
    output
        Folder of the pages; it is made if it does not exist.
    language
        Code of a language, en or de. Can be repeated: the pages then link to each other.
    """
    from decals.apps.lab.lesson import LESSONS, load_lessons
    from decals.apps.lesson_pages.page import lesson_page, no_page
    from decals.apps.lesson_pages.translation import translation

    loaded = load_lessons(LESSONS if folder is None else folder)
    words = {code: translation(code) for code in dict.fromkeys(language)}
    reasons = {lesson.name: no_page(lesson) for lesson in loaded}
    shown = [lesson for lesson in loaded if not reasons[lesson.name]]
    if not shown:
        raise InvalidInput(f"lessons: none has a page: {'; '.join(map(str, reasons.values()))}")
    with output_folder(output, InvalidInput):
        for code, own in words.items():

            def name(lesson: str, code: str = code) -> str:
                return f"{lesson}.html" if code == next(iter(words)) else f"{lesson}.{code}.html"

            for number, lesson in enumerate(shown):
                beside = {"previous": number - 1, "next": number + 1}
                links = [
                    (f"{own.page[which]}: {own.said(shown[at].settings.title)}", name(shown[at].name))
                    for which, at in beside.items()
                    if 0 <= at < len(shown)
                ]
                links += [(other.name, name(lesson.name, to)) for to, other in words.items() if to != code]
                path = output / name(lesson.name)
                with progress_bars() as progress:
                    lesson_page(lesson, language=code, links=links, progress=progress).save(path)
                print_path(path)
    for reason in filter(None, reasons.values()):
        Console().print(f"left out: {reason}", soft_wrap=True, highlight=False, markup=False)
