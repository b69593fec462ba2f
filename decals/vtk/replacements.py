"""Code that is put into VTK's shaders of an actor, beside what somebody else put there."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from vtkmodules.vtkCommonCore import reference

Place = tuple[str, str]
"""A stage (Vertex, Geometry or Fragment), and one of the tags in VTK's code for it."""


@dataclass(frozen=True)
class Replacement:
    """What stands in place of a tag, and whether wherever the tag is found."""

    text: str
    everywhere: bool = False


class Additions:
    """Code of ours behind tags of VTK's; tags, and what others put in their place, stay.

    Parameters
    ----------
    actor
        A vtkActor; its shader property is asked for whenever it is needed.
    """

    def __init__(self, actor: Any) -> None:
        self._actor = actor
        self._ours: dict[Place, Replacement] = {}
        self._theirs: dict[Place, Replacement | None] = {}

    def write(self, code: Mapping[Place, str]) -> None:
        """Let this be our code; what others changed since stays too."""
        for place, text in code.items():
            now = self._now(place)
            if now is None or now != self._ours.get(place):
                self._theirs[place] = now
            theirs = self._theirs[place] or Replacement(place[1])
            wanted = Replacement(f"{theirs.text}\n{text}", theirs.everywhere)
            if now != wanted:
                self._put(place, wanted)
            self._ours[place] = wanted

    def erase(self) -> None:
        """Leave what others put there, and VTK's own code."""
        for place, ours in self._ours.items():
            if self._now(place) == ours:
                self._put(place, self._theirs[place])
        self._ours.clear()
        self._theirs.clear()

    def _now(self, place: Place) -> Replacement | None:
        """What stands in place of a tag, before VTK puts its own code there."""
        shader = self._actor.GetShaderProperty()
        for number in range(shader.GetNumberOfShaderReplacements()):
            tag, first, text, everywhere = (reference(value) for value in ("", False, "", False))
            shader.GetNthShaderReplacement(number, tag, first, text, everywhere)
            if first and (shader.GetNthShaderReplacementTypeAsString(number), str(tag)) == place:
                return Replacement(str(text), bool(everywhere))
        return None

    def _put(self, place: Place, wanted: Replacement | None) -> None:
        (stage, tag), shader = place, self._actor.GetShaderProperty()
        getattr(shader, f"Clear{stage}ShaderReplacement")(tag, True)
        if wanted is not None:
            add = getattr(shader, f"Add{stage}ShaderReplacement")
            add(tag, True, wanted.text, wanted.everywhere)
