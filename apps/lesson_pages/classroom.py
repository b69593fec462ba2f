"""A class: students take pages of lessons from the teacher's server, and send their numbers to it.

The address of a student has a token of its own, which opens the pages and takes answers, and nothing else.
"""

import asyncio
import base64
import csv
import hashlib
import hmac
import io
import math
import re
import secrets
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from html import escape
from pathlib import Path

import msgspec
from aiohttp import web

from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.lesson import Lesson
from decals.apps.lesson_pages.board import Answer, Choice, board, labels, table
from decals.apps.lesson_pages.page import lesson_page, no_page
from decals.apps.sandbox.guard import FRAMES, NEAR, Guard, new_token, page_of

STUDENT, ANSWER = "/student/", "answer"
"""Beginning of the addresses of students, and the name to which they send answers."""

MAX_STUDENTS = 200
"""Most browsers of a class."""

MAX_BYTES = 2000
"""Longest answer."""

MAX_NAME = 40
"""Most characters of the name of a student."""

LEAST_SECONDS = 0.5
"""Least time between two answers of a student."""

MAX_RATE = 100
"""Most requests to answer in a second, of all students together."""

BODY_SECONDS = 10.0
"""Time in which an answer must have come."""

SCRIPT = Path(__file__).with_name("class.mjs")

POLICY = (
    "default-src 'none'; script-src 'sha256-{}'; style-src 'unsafe-inline'; img-src data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What a student's page may load: its own script, and nothing of other pages."""

FORMULA = tuple("=+-@\t\r")
"""First characters of a text that a spreadsheet would compute."""


class Classroom:
    """Serves pages to students, and their answers to the teacher.

    Parameters
    ----------
    guard
        Checks the requests of the teacher; those of students have their own token.
    lessons
        The lessons; those without a page are left out.

    Raises
    ------
    InvalidLesson
        None of them has a page.

    Attributes
    ----------
    token
        The token of students.
    answers
        The newest answer by the number of its student, and its lesson.
    """

    def __init__(self, guard: Guard, lessons: Sequence[Lesson]) -> None:
        self._guard = guard
        reasons = {lesson.name: no_page(lesson) for lesson in lessons}
        self._lessons = {lesson.name: lesson for lesson in lessons if not reasons[lesson.name]}
        if not self._lessons:
            raise InvalidLesson(
                f"a class needs a lesson with a page: {'; '.join(map(str, reasons.values()))}"
            )
        self.token = new_token()
        self.answers: dict[tuple[int, str], Answer] = {}
        self._secret = secrets.token_bytes(32)
        self._times: dict[int, float] = {}
        self._second, self._asked = 0, 0
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="pages")
        self._pages: dict[str, asyncio.Future[str]] = {}

    def url(self, port: int) -> str:
        """Return the address of students."""
        return f"{self._guard.origin(port)}{STUDENT}{self.token}/"

    def join(self, app: web.Application) -> None:
        """Answer requests of students before the guard does, and those of the teacher behind it."""
        self._guard.doors[STUDENT] = self._answer
        app.router.add_get("/class", self._board)
        app.router.add_get("/class/answers", self._answers)
        app.router.add_get("/class/class.mjs", _script)
        app.router.add_get("/class/{name}.csv", self._table)

    # -- students ---------------------------------------------------------------------------------------

    async def _answer(self, request: web.Request) -> web.Response:
        """Answer a request of a student, or refuse it."""
        token, _, name = request.path.removeprefix(STUDENT).partition("/")
        self._guard.check_names(request)
        if not hmac.compare_digest(token.encode(errors="replace"), self.token.encode()):
            raise web.HTTPForbidden(text="expected the address that the teacher shows")
        if name == ANSWER:
            return await self._take(request)
        if request.method != "GET":
            raise web.HTTPMethodNotAllowed(request.method, ["GET"])
        if request.headers.get("Sec-Fetch-Dest") in FRAMES:
            raise web.HTTPForbidden(text="expected a window for the page, not a frame")
        response = await self._page(name.removesuffix(".html"), request)
        number = self._number(request) or len(self._times) + 1  # others may have come meanwhile
        if number > MAX_STUDENTS:
            return page_of(f"The class is full: it has {MAX_STUDENTS} students.", 503)
        self._times.setdefault(number, -math.inf)
        path = f"{STUDENT}{self.token}/"  # all ports of a machine share its cookies
        response.set_cookie(
            "class", f"{number}.{self._signature(number)}", path=path, httponly=True, samesite="Strict"
        )
        return response

    def _signature(self, number: int) -> str:
        return hmac.new(self._secret, str(number).encode(), hashlib.sha256).hexdigest()

    def _number(self, request: web.Request) -> int:
        """Return the number of a student from the cookie, or 0."""
        text, _, signature = request.cookies.get("class", "").partition(".")
        known = re.fullmatch(r"[1-9]\d{0,3}", text) and hmac.compare_digest(
            signature.encode(errors="replace"), self._signature(int(text)).encode()
        )
        return int(text) if known else 0

    async def _page(self, name: str, request: web.Request) -> web.Response:
        """Return the page of a lesson, which is made once, or the list of all."""
        if not name:
            names = self._lessons.items()
            rows = "".join(f"<li><a href='{n}.html'>{escape(one.settings.title)}</a>" for n, one in names)
            return _limited(LIST.format(rows))
        if name not in self._lessons:
            raise web.HTTPNotFound(text="expected a page of a lesson")
        if name not in self._pages:
            self._pages[name] = asyncio.get_running_loop().run_in_executor(
                self._worker,
                lambda: lesson_page(self._lessons[name], links=[("Lessons", "./")], sends=True).text,
            )
        return _limited(await asyncio.shield(self._pages[name]))

    async def _take(self, request: web.Request) -> web.Response:
        """Take an answer: the one thing that a student can send."""
        now, number = time.monotonic(), self._number(request)
        self._second, self._asked = int(now), self._asked + 1 if self._second == int(now) else 1
        if self._asked > MAX_RATE:
            raise web.HTTPTooManyRequests(text="expected fewer answers of the class")
        if request.method != "POST" or request.content_type != "application/json":
            raise web.HTTPMethodNotAllowed(request.method, ["POST"], text="expected an answer in JSON")
        if request.headers.get("Sec-Fetch-Site", NEAR[0]) not in NEAR or "Origin" not in request.headers:
            raise web.HTTPForbidden(text="expected an answer of a student's page")
        if number not in self._times:
            raise web.HTTPForbidden(text="expected a student; load the page again")
        if (request.content_length or MAX_BYTES + 1) > MAX_BYTES:
            raise web.HTTPRequestEntityTooLarge(MAX_BYTES, text=f"expected at most {MAX_BYTES} bytes")
        if now - self._times[number] < LEAST_SECONDS:
            raise web.HTTPTooManyRequests(text="expected fewer answers; wait a second")
        self._times[number] = now
        try:
            async with asyncio.timeout(BODY_SECONDS):
                answer = msgspec.json.decode(await request.read(), type=Answer)
        except (msgspec.MsgspecError, UnicodeDecodeError, TimeoutError):
            raise web.HTTPBadRequest(text="expected an answer of a lesson") from None
        lesson = self._lessons.get(answer.lesson)
        fits = lesson is not None and len(answer.numbers) == len(labels(lesson))
        finite = all(value is None or math.isfinite(value) for value in answer.numbers)
        if not fits or not finite or len(answer.name) > MAX_NAME or not answer.name.isprintable():
            raise web.HTTPBadRequest(text="expected an answer of a lesson")
        self.answers[number, answer.lesson] = answer
        return web.Response(status=204)

    # -- the teacher ------------------------------------------------------------------------------------

    async def _board(self, request: web.Request) -> web.Response:
        port = request.get_extra_info("sockname")[1]
        return _html(board(self.url(port), self._lessons, Choice.of(self._lessons, request.query)))

    async def _answers(self, request: web.Request) -> web.Response:
        choice = Choice.of(self._lessons, request.query)
        response = _html(table(choice, self._answers_to(choice.lesson)))
        response.headers["Cache-Control"] = "no-store"
        return response

    def _answers_to(self, lesson: Lesson) -> dict[int, Answer]:
        """Return the newest answers to a lesson, by the numbers of the students."""
        return {who: one for (who, name), one in sorted(self.answers.items()) if name == lesson.name}

    async def _table(self, request: web.Request) -> web.Response:
        """Return the answers to a lesson as CSV, without texts that a spreadsheet would compute."""
        lesson = self._lessons.get(request.match_info["name"])
        if lesson is None:
            raise web.HTTPNotFound(text="expected the name of a lesson")
        file = io.StringIO()
        rows = csv.writer(file)
        rows.writerow(["student", "name", "right", *labels(lesson)])
        for student, one in self._answers_to(lesson).items():
            shown = f"'{one.name}" if one.name.startswith(FORMULA) else one.name
            rows.writerow([student, shown, one.right, *one.numbers])
        headers = {"Content-Disposition": f'attachment; filename="{lesson.name}.csv"'}
        return web.Response(text=file.getvalue(), content_type="text/csv", headers=headers)


LIST = (
    "<!doctype html><html lang='en'><meta charset='utf-8'><title>Lessons</title>"
    "<meta name='viewport' content='width=device-width'>"
    "<style>body {{ font: 18px/2 sans-serif; margin: 2em }}</style>"
    "<h1>Lessons</h1><ul>{}</ul></html>"
)


def _html(text: str) -> web.Response:
    return web.Response(text=text, content_type="text/html")


def _limited(text: str) -> web.Response:
    """Return a page of a student, which may run the script that it has, and load nothing."""
    script = re.search(r"<script>(.*?)</script>", text, re.DOTALL)
    digest = hashlib.sha256((script[1] if script else "").encode()).digest()
    response = _html(text)
    response.headers["Content-Security-Policy"] = POLICY.format(base64.b64encode(digest).decode())
    return response


async def _script(_request: web.Request) -> web.Response:
    return web.Response(text=SCRIPT.read_text(encoding="utf-8"), content_type="text/javascript")
