"""Names and recorded paths of version 0.1 keep working."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

import sonata2d as s2
from sonata2d.agents.controllers.base import RECORDED_PATHS, recorded_path
from sonata2d.agents.controllers.loading import find_controller

TWIST = s2.Twist(0.5)


class Still(s2.Controller):
    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist()


@pytest.mark.parametrize(("current", "recorded"), RECORDED_PATHS.items())
def test_recorded_paths_name_the_classes_of_today(current: str, recorded: str) -> None:
    kind = find_controller(recorded)
    assert f"{kind.__module__}:{kind.__qualname__}" == current
    assert recorded_path(kind) == recorded


def test_a_method_with_an_old_name_is_called_and_warned_about_at_the_class() -> None:
    with pytest.warns(DeprecationWarning, match="Old.overruled is deprecated; rename it command_overridden") as caught:

        class Old(Still):
            def overruled(self, twist: s2.Twist) -> None:
                self.seen = twist

    assert caught[0].filename == __file__
    controller = Old()
    controller.command_overridden(TWIST)
    assert controller.seen == TWIST


def test_an_old_name_in_a_mixin_is_called() -> None:
    class Mixin:
        def overruled(self, twist: s2.Twist) -> None:
            self.seen = twist

    with pytest.warns(DeprecationWarning, match="overruled is deprecated"):

        class Mixed(Mixin, Still):
            pass

    controller = Mixed()
    controller.command_overridden(TWIST)
    assert controller.seen == TWIST


def test_calling_an_old_name_calls_the_new_method() -> None:
    class New(Still):
        speed = 0.0

        @classmethod
        def from_settings(cls, settings: Mapping[str, Any]) -> New:
            controller = cls()
            controller.speed = settings["speed"]
            return controller

    with pytest.warns(DeprecationWarning, match="Controller.restored is deprecated; use from_settings"):
        assert New.restored({"speed": 0.7}).speed == 0.7
    with pytest.warns(DeprecationWarning, match="restored"):
        assert isinstance(Still.restored({}), Still)


def test_an_old_method_may_call_its_base_class_by_the_old_name() -> None:
    with pytest.warns(DeprecationWarning, match="Old.restored"):

        class Old(Still):
            @classmethod
            def restored(cls, settings: Mapping[str, Any]) -> Old:
                with pytest.warns(DeprecationWarning, match="Controller.restored"):
                    return super().restored(settings)

    assert isinstance(Old.from_settings({}), Old)


def test_error_classes_are_attributes_of_the_package() -> None:
    assert issubclass(s2.errors.SceneError, s2.Sonata2dError)
