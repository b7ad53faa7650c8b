"""Ten jobs of an engineer by the tools alone, each beside a figure of its own."""

from __future__ import annotations

import pytest

from agent_calls import filled, worked
from paths import demo

pytestmark = [
    pytest.mark.fem,
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore"),  # also of the picture of a map of one site
]


def test_ten_jobs_are_right(tmp_path):
    agents = demo("agents")
    calls = [(job.tool, job.arguments) for job in agents.jobs()]
    rows = agents.checked(worked(filled(tmp_path), calls))
    assert len(rows) == 10
    for question, found, figure in rows:
        assert found == pytest.approx(figure, rel=0.03), question
