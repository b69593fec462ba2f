"""A class of forty students, what the teacher sees of it, and attacks by a student."""

import asyncio
import csv
import io
import json
import re
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

pytest.importorskip("aiohttp")
pytest.importorskip("trame_server")

import aiohttp
import numpy as np
from yarl import URL

from decals.apps.cli import run
from decals.apps.lab.lesson import LESSONS, load_lesson
from decals.apps.lesson_pages import classroom
from decals.apps.lesson_pages.board import Answer, Choice, labels, table
from decals.apps.lesson_pages.classroom import MAX_RATE, MAX_STUDENTS, Classroom
from decals.apps.sandbox.guard import Guard
from decals.apps.sandbox.sessions import Sessions
from decals.errors import InvalidInput
from tests.apps.sandbox.attacks import NAVIGATE, Server, student
from tests.apps.sandbox.test_sessions import PROGRAM, TOKEN

STUDENTS = 40


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let processes of sessions write their files into a folder of the test."""
    monkeypatch.chdir(tmp_path)


def serve(check: Callable[[Classroom, str], Awaitable[None]]) -> Sessions:
    """Serve a class to a check, then end it."""
    return asyncio.run(served(check))


async def served(check: Callable[[Classroom, str], Awaitable[None]]) -> Sessions:
    guard = Guard(token=TOKEN)
    names = ("1-one-decal", "7-volume-and-area", "9-packing")
    room = Classroom(guard, [load_lesson(LESSONS / f"{name}.md") for name in names])
    command = [sys.executable, "-c", PROGRAM, "1"]
    sessions = Sessions(lambda _: command, limit=2, guard=guard, join=room.join)
    port: asyncio.Future[int] = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(sessions.serve("127.0.0.1", 0, port.set_result))
    try:
        await check(room, guard.address(await port))
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    return sessions


def students(address: str) -> str:
    """Return the beginning of the address of students, which lacks the path of the teacher's page."""
    return f"{URL(address).origin()}/student"


def pupil() -> aiohttp.ClientSession:
    return aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True), headers=NAVIGATE)


async def answer(http: aiohttp.ClientSession, address: str, room: Classroom, **changes: Any) -> int:
    sent = {
        "lesson": "9-packing",
        "name": "",
        "numbers": [20.0, 0.5, 0.4, 90.0, 1.0, 4.0],
        "right": True,
        **changes,
    }
    own = {"Origin": str(URL(address).origin()), "Sec-Fetch-Site": "same-origin", "Sec-Fetch-Mode": "cors"}
    async with http.post(f"{students(address)}/{room.token}/answer", json=sent, headers=own) as found:
        return int(found.status)


def test_forty_students_answer_and_the_teacher_sees_all() -> None:
    async def check(room: Classroom, address: str) -> None:
        async def learns(number: int) -> None:
            async with pupil() as http:
                async with http.get(f"{students(address)}/{room.token}/") as found:
                    assert "9-packing.html" in await found.text()
                for turn in range(3):
                    numbers = [float(number), 0.5, 0.4, 50.0 + turn, 1.0, None]
                    assert await answer(http, address, room, name=f"=Ü {number}", numbers=numbers) == 204
                    await asyncio.sleep(0.55)

        async with pupil() as first, first.get(f"{students(address)}/{room.token}/9-packing.html") as page:
            assert "Send my numbers" in await page.text()
            assert "script-src 'sha256-" in page.headers["Content-Security-Policy"]
        await asyncio.gather(*(learns(number) for number in range(STUDENTS)))
        async with pupil() as teacher:
            async with teacher.get(f"{address}?token={TOKEN}") as found:
                assert found.status == 200
            near = {"Sec-Fetch-Site": "same-origin", "Sec-Fetch-Mode": "cors"}
            asked = f"{address}class/answers?lesson=9-packing&x=0&y=3"
            async with teacher.get(asked, headers=near) as found:
                seen = await found.text()
            texts = [re.findall("<td>(.*?)</td>", line) for line in re.findall("<tr>(.*?)</tr>", seen)[1:]]
            assert sorted(int(line[2]) for line in texts) == [*range(STUDENTS)]
            assert {line[5] for line in texts} == {"52"}  # the newest ones
            assert {line[7] for line in texts} == {"–"}
            names = re.findall("<th>(.*?)</th>", seen)
            assert names == ["student", "done", *labels(load_lesson(LESSONS / "9-packing.md"))]
            dots = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', seen)
            assert np.ptp(np.diff(sorted(float(x) for x, _ in dots))) < 0.2  # guesses are even
            assert len({y for _, y in dots}) == 1
            assert len(dots) == STUDENTS
            async with teacher.get(f"{address}class/9-packing.csv", headers=near) as found:
                rows = [*csv.DictReader(io.StringIO(await found.text()))]
            assert {row["name"] for row in rows} == {f"'=Ü {number}" for number in range(STUDENTS)}
            assert {float(row["guess"]) for row in rows} == {*range(STUDENTS)}
            async with teacher.get(f"{address}class?lesson=9-packing&x=0&y=9") as found:
                text = await found.text()
            assert f"{students(address)}/{room.token}/" in text
            assert re.findall('<option value="([^"]+)" selected>', text) == ["9-packing", "0", "5"]

    sessions = serve(check)
    assert len(sessions._numbers) == 1  # the teacher alone has a process


def test_attacks_of_a_student_are_refused() -> None:
    async def check(room: Classroom, address: str) -> None:
        lines = [room.url(URL(address).port or 0)]
        got = await student(Server("--class", cast("Any", None), Path(), address, TOKEN, lines))
        assert not got

    serve(check)


def test_a_class_has_so_many_students_and_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    async def check(room: Classroom, address: str) -> None:
        statuses = []
        for _ in range(MAX_STUDENTS + 1):
            async with pupil() as http, http.get(f"{students(address)}/{room.token}/") as found:
                statuses.append(found.status)
        assert statuses == [200] * MAX_STUDENTS + [503]
        async with pupil() as http:
            monkeypatch.setattr(classroom, "time", SimpleNamespace(monotonic=lambda: 5.0))  # one second
            asked = [answer(http, address, room) for _ in range(MAX_RATE + 50)]
            codes = [await one for one in asked]
        assert codes == [403] * MAX_RATE + [429] * 50
        assert len(room.answers) == 0

    serve(check)


def test_students_who_wait_for_one_page_are_told_apart() -> None:
    """A page is made when it is first opened, which takes seconds; a class opens it at once."""

    async def check(room: Classroom, address: str) -> None:
        async def learns(number: int) -> None:
            async with pupil() as http:
                async with http.get(f"{students(address)}/{room.token}/9-packing.html") as found:
                    assert found.status == 200
                assert await answer(http, address, room, name=str(number)) == 204

        await asyncio.gather(*map(learns, range(8)))
        assert sorted(one.name for one in room.answers.values()) == [*map(str, range(8))]

    serve(check)


def test_a_student_of_two_classes_on_one_machine_is_one_student_in_each() -> None:
    async def first(room: Classroom, address: str) -> None:
        async def second(other: Classroom, elsewhere: str) -> None:
            async with pupil() as http:
                for turn in range(2):
                    for one, place in ((room, address), (other, elsewhere)):
                        async with http.get(f"{students(place)}/{one.token}/"):
                            assert await answer(http, place, one, name=str(turn)) == 204
                    await asyncio.sleep(0.55)
            for one in (room, other):
                assert [found.name for found in one.answers.values()] == ["1"]

        await served(second)

    serve(first)


def test_texts_of_students_are_no_markup() -> None:
    lesson = load_lesson(LESSONS / "1-one-decal.md")
    bad = "<img src=x onerror=alert(1)>"
    choice = Choice.of({lesson.name: lesson}, {"lesson": bad, "x": bad})
    assert (choice.lesson, choice.x, choice.y) == (lesson, 1, 3)
    answers = {7: Answer(lesson.name, bad, (None, 1.0, 2.0, 3.0), True)}
    assert "<img" not in table(choice, answers)
    assert "&lt;img src=x" in table(choice, answers)
    assert "student 7" in table(choice, {7: Answer(lesson.name, "", (None,) * 4, False)})


def test_a_class_needs_lessons(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InvalidInput, match="needs a lesson with a page: Scattering: a relaxation"):
        Classroom(Guard(token=TOKEN), [load_lesson(LESSONS / "5-scattering.md")])
    assert run(["sandbox", "--class"]) != 0
    assert "--class needs --lab or --lessons" in capsys.readouterr().err
    assert json.dumps(labels(load_lesson(LESSONS / "1-one-decal.md"))).startswith('["guess"')
