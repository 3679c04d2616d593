"""Run episodes in tests."""

from __future__ import annotations

import sonata2d as s2


def record_of(scene: s2.Scene, controller: s2.Controller | None = None) -> s2.EpisodeRecord:
    """The record of an episode; by default `social-planner` drives."""
    recorder = s2.EpisodeRecorder()
    s2.Episode(scene, controller or s2.SocialPlanner(), observers=[recorder]).run()
    return recorder.record()
